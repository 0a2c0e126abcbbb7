"""Where the worker starts, in a process of its own, with whichever Blender there is:

    blender --background --factory-startup --python worker.py
    python worker.py                          where bpy is a Python module

It takes a job a line and answers a line each, see `core.library.serving`; `job` says what is in
them. It finds the package by its own place and calls it `sunsplit`, whatever it is installed as;
nothing is registered.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAME = "sunsplit"


def main() -> None:
    if NAME not in sys.modules:
        root = Path(__file__).resolve().parents[2]
        spec = importlib.util.spec_from_file_location(
            NAME, root / "__init__.py", submodule_search_locations=[str(root)]
        )
        if spec is None or spec.loader is None:
            raise ImportError(f"{root} holds no package")
        sys.modules[NAME] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    with _stdout_to_stderr():
        _find_libraries()
        writing = importlib.import_module(f"{NAME}.addon.asset_library.writing")
    sys.stdin.readline()  # where others import from: Blender knows better
    serving = importlib.import_module(f"{NAME}.core.library.serving")
    serving.serve(writing.answer)


def _find_libraries() -> None:
    """Without a user's preferences Blender does not look where extensions have their libraries."""
    import bpy

    version = "python{}.{}".format(*sys.version_info)
    place = Path(".local", "lib", version, "site-packages")
    found = bpy.utils.user_resource("EXTENSIONS", path=str(place))
    if found and found not in sys.path:
        sys.path.append(found)


@contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Blender has things to say as soon as it is imported: not among the answers."""
    answers = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(answers, 1)
        os.close(answers)


if __name__ == "__main__":
    try:
        main()
    except Exception:  # Blender would go on, and end as if all were well
        traceback.print_exc()
        sys.exit(1)
