"""The worker's side of a Dask cluster: see `cluster` for the other one.

It is found by its name, so that the scheduler needs no Sunsplit, nor must the one who asks know it
by the same name: inside Blender it has another.
"""

from __future__ import annotations

import gc
import os
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ..version import version
from .processes import ONE_CORE
from .run_token import has_token
from .work import MapJob, convert_map

Answer = dict[str, Any]
"""Either result: a `MapResult` as JSON; or obstacle: why this worker cannot do anything for the
run, to be read after its name. install: whether the cure is another Sunsplit."""


def convert(job: dict[str, Any], token: str) -> Answer:
    """Convert a map for the run with this token. What raises is a bug."""
    if job["version"] != version():
        return _obstacle(
            f"has Sunsplit {version()}, and {job['version']} was asked for: install the same one "
            "everywhere",
            install=True,
        )
    library, output = Path(job["library"]), Path(job["output"])
    if not has_token(output, token):
        return _obstacle(f"does not see the folder {output} that is to be shared under this path")
    if not _holds_anything(library):
        return _obstacle(f"does not see the folder {library} that is to be shared under this path")
    _prepare()
    try:
        return {"result": convert_map(MapJob.from_json(job)).to_json()}
    finally:
        gc.collect()  # maps lie in cycles, and would stay until there are many


def _obstacle(sentence: str, install: bool = False) -> Answer:
    return {"obstacle": sentence, "install": install}


def _holds_anything(folder: Path) -> bool:
    """Where a drive is not mounted, there may be an empty folder."""
    try:
        with os.scandir(folder) as entries:
            return any(True for _ in entries)
    except OSError:
        return False


@cache
def _prepare() -> None:
    """A process may do many tasks at once: threads of each would wait for one another."""
    os.environ.update(ONE_CORE)
    # What takes long to import, before the first map: none of them shall be charged with it.
    for name in ("conversion", "files.conversion", "files.maps"):
        import_module(f"...{name}", __name__)
    # Looking through all that is imported, after each map, would take longer than small maps do.
    gc.collect()
    gc.freeze()
