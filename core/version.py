"""Which Sunsplit this is."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def version() -> str:
    """From the add-on's manifest; a package that pip has installed has metadata instead."""
    import tomllib
    from importlib import metadata

    manifest = Path(__file__).parent.parent / "blender_manifest.toml"
    try:
        return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
    except FileNotFoundError:
        return metadata.version("sunsplit")
