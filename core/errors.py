"""Errors that a user can do something about; everything else is a bug and raises as itself."""


class SunsplitError(Exception):
    """A clear sentence for the user: what is wrong and what to do about it."""


class UnusableInput(SunsplitError):
    """The given file, map or world cannot be converted."""


class CannotWrite(SunsplitError):
    """The result could not be written; what was there before is still there."""


class ClusterFailed(SunsplitError):
    """The machines that were to work cannot be reached or used; what they have done stays done."""
