"""What was made of a thing, kept with it: asked for again, it is not made again."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cached_property
from typing import Any, TypeVar, cast

Made = TypeVar("Made")


class Memo:
    """Of a frozen thing, whose parts cannot change afterwards. It goes when the thing goes."""

    @cached_property
    def _made(self) -> dict[Hashable, Any]:
        return {}

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """What `make` gives, called for the first time only. The key tells things apart that are
        made of the same thing."""
        if key not in self._made:
            self._made[key] = make()
        return cast(Made, self._made[key])

    def latest(self, name: str, key: Hashable, make: Callable[[], Made]) -> Made:
        """The same for what is large: only the last one of a name is kept."""
        if self._made.get(name, (None,))[0] != (key,):
            self._made[name] = ((key,), make())
        return cast(Made, self._made[name][1])
