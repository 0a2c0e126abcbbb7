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
import sys
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
    serving = importlib.import_module(f"{NAME}.core.library.serving")
    writing = importlib.import_module(f"{NAME}.addon.asset_library.writing")
    serving.serve(writing.answer)


if __name__ == "__main__":
    main()
