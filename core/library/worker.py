"""A process that converts maps for another one: see `serving`.

It is started as a file, and not as a module of a package: inside Blender the package has a name
that no other process knows, and a user's script must not be run once more.
"""

import json
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path


def main() -> None:
    greeting = json.loads(sys.stdin.readline())
    sys.path[:] = greeting["path"]
    _load_package()
    serving, work = (import_module(f"sunsplit.core.library.{n}") for n in ("serving", "work"))
    import gc

    for name in ("conversion", "files.conversion", "files.maps"):
        import_module(f"sunsplit.core.{name}")
    gc.freeze()  # what is there by now stays: it need not be looked at after each map

    def convert(job: dict) -> dict:
        try:
            return work.convert_map(work.MapJob.from_json(job)).to_json()
        finally:
            gc.collect()  # maps lie in cycles, and would stay until there are many

    serving.serve(convert)
    gc.unfreeze()  # libraries look for what is left when Python ends, and complain


def _load_package() -> None:
    """This very Sunsplit as the package `sunsplit`, whichever else may be installed."""
    root = Path(__file__).resolve().parents[2]
    spec = spec_from_file_location(
        "sunsplit", root / "__init__.py", submodule_search_locations=[str(root)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"no package in {root}")
    package = module_from_spec(spec)
    sys.modules["sunsplit"] = package
    spec.loader.exec_module(package)


if __name__ == "__main__":
    main()
