"""A Blender with a window for the tests: the one of Debian's `sid`, in a folder of its own.

The folder is a whole small Debian, made with mmdebstrap and used with chroot, without mounts. It is
built once (under a minute) and kept in the user's cache directory, or where SUNSPLIT_CACHE says.
That needs root and Debian's apt; `Unavailable` says what is missing.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

SUITE = "sid"
"""The only suite with a Blender that Sunsplit supports."""

TOOLS = {"mmdebstrap": "mmdebstrap", "Xvfb": "xvfb", "xdotool": "xdotool"}
"""Programs that run outside of the folder, and the Debian packages that have them."""

PACKAGES = (
    *("blender", "libegl1", "libgl1", "libglx-mesa0", "libgl1-mesa-dri", "python3-numpy"),
    # What Blender's own extension system imports.
    *("python3-requests", "python3-zstandard", "python3-cattr", "python3-fastjsonschema"),
)

OPTIONS = (
    "--variant=apt",
    f"--include={','.join(PACKAGES)}",
    # A mirror that lags behind is as good.
    '--aptopt=Acquire::Check-Valid-Until "false"',
    # A folder that is cut short is thrown away, so nothing has to be on the disk at once.
    "--dpkgopt=force-unsafe-io",
    *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in ("doc", "man", "locale")),
)


SHARED = "sunsplit-"
"""How the names of folders begin that a window and its tests share."""


class Unavailable(Exception):
    """Why there can be no such Blender on this machine."""


class BuildFailed(Exception):
    """Why it is not there although it could be."""


@dataclass(frozen=True)
class Debian:
    """A folder that holds a whole Debian with Blender."""

    root: Path

    def command(self, *arguments: str) -> list[str]:
        """A command that runs there; paths in it are as seen from inside."""
        return ["chroot", str(self.root), *arguments]

    def inside(self, path: Path) -> str:
        """A path below the folder, as a program inside sees it."""
        return f"/{path.relative_to(self.root)}"

    def environment(self, home: str = "/root") -> dict[str, str]:
        """All that programs there get to know, as paths from inside; Blender keeps to its home."""
        return {
            "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
            "HOME": home,
            "TMPDIR": home,
            "BLENDER_USER_RESOURCES": f"{home}/blender",
        }

    def ask(self, *arguments: str, home: str = "/root") -> str:
        """What a program there prints. Raises CalledProcessError."""
        done = subprocess.run(
            self.command(*arguments),
            check=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=120,
            env=self.environment(home),
        )
        return done.stdout.strip()

    @contextmanager
    def shared_folder(self) -> Iterator[Path]:
        """An empty folder that both sides see, for as long as the block takes."""
        place = self.root / "tmp"
        for old in place.glob(f"{SHARED}*"):
            # One that nobody holds is of tests that were killed.
            with suppress(BlockingIOError, FileNotFoundError), _held(old):
                shutil.rmtree(old)
        folder = Path(tempfile.mkdtemp(prefix=SHARED, dir=place))
        with _held(folder):
            try:
                yield folder
            finally:
                shutil.rmtree(folder)

    @property
    def blender(self) -> str:
        """Blender's version, as `5.2`."""
        return ".".join(self.ask("blender", "--version").split()[1].split(".")[:2])

    @property
    def python(self) -> str:
        """The version of the Python inside that Blender, as `3.14`."""
        code = "import sys; print('{}.{}'.format(*sys.version_info))"
        return self.ask("python3", "-c", code)


def debian() -> Debian:
    """The folder, built if it is not there. Raises Unavailable, BuildFailed."""
    if os.geteuid() != 0:
        raise Unavailable("a window's Blender is set up with chroot, which needs root")
    if shutil.which("apt-get") is None:
        raise Unavailable("a window's Blender is set up with Debian's apt, which is not here")
    recipe = hashlib.sha256("\n".join([SUITE, *OPTIONS]).encode()).hexdigest()[:8]
    cache = cache_folder()
    root = cache / f"blender-{SUITE}-{recipe}"
    with _alone(cache / f"blender-{SUITE}.lock"):
        _install_tools()
        if not root.exists():
            _build(root)
    return Debian(root)


def cache_folder() -> Path:
    """Where the folder is kept; it is made."""
    user = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("SUNSPLIT_CACHE") or Path(user) / "sunsplit-tests")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock: of two runs, the second waits and finds what the first has built."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold a folder's lock. Raises BlockingIOError if another process does."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _install_tools() -> None:
    packages = [package for tool, package in TOOLS.items() if shutil.which(tool) is None]
    if packages:
        _run(["apt-get", "update", "-qq"])
        options = ("-y", "-qq", "--no-install-recommends", "-o", "DPkg::Lock::Timeout=60")
        _run(["apt-get", "install", *options, *packages])


def _build(root: Path) -> None:
    """Build under another name: what has the right one is whole."""
    part = root.with_name(f"{root.name}.part")
    # mmdebstrap mounts only in a namespace of its own; still, never remove across a mount.
    _run(["rm", "-rf", "--one-file-system", str(part)])
    options = [*OPTIONS, *(f"--aptopt={line}" for line in _connection())]
    _run(["mmdebstrap", "--quiet", *options, SUITE, str(part), _mirror()])
    part.rename(root)


def _mirror() -> str:
    """The Debian archive that this machine uses. Raises Unavailable."""
    wanted = ("Created-By: Packages", "Origin: Debian", "Label: Debian")
    command = ["apt-get", "indextargets", "--format", "$(REPO_URI)", *wanted]
    found = _run(command).split()
    if not found:  # apt learns the origins of its archives when it updates
        _run(["apt-get", "update", "-qq"])
        found = _run(command).split()
    if not found:
        raise Unavailable("this machine's apt has no Debian archive to take Blender from")
    return found[0]


def _connection() -> list[str]:
    """This machine's settings of apt for its connection, such as a proxy."""
    names = ("Acquire::http", "Acquire::https")
    return _run(["apt-config", "dump", "--no-empty", "--format", '%f "%v";%n', *names]).splitlines()


def _run(command: Sequence[str]) -> str:
    """What a program prints. Raises BuildFailed with the end of what it said."""
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=1200, env=environment
    )
    if done.returncode != 0:
        said = "\n".join((done.stdout + done.stderr).strip().splitlines()[-10:])
        raise BuildFailed(f"{command[0]} failed:\n{said}")
    return done.stdout
