"""Sunsplit's core: from an HDRI to suns, a residual map and an account. No bpy in here.

from sunsplit.core import ConversionSettings, convert, load, save

conversion = convert(load("sky.hdr"), ConversionSettings(lights=4))
save(conversion, "out", preview=True)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .conversion import Conversion, convert
    from .environment import EnvironmentMap
    from .errors import SunsplitError
    from .export.mitsuba import mitsuba_dict
    from .export.run import export_conversion
    from .export.settings import ExportSettings
    from .export.skylight import read_skylight, skylight_of
    from .files.conversion import account_of_files, save
    from .files.maps import load
    from .files.samples_json import read_samples
    from .library.options import LibraryOptions
    from .library.run import LibraryResult, convert_library
    from .settings import ConversionSettings
    from .suspicions import map_warnings

_HOMES = {
    "Conversion": "conversion",
    "ConversionSettings": "settings",
    "EnvironmentMap": "environment",
    "ExportSettings": "export.settings",
    "LibraryOptions": "library.options",
    "LibraryResult": "library.run",
    "SunsplitError": "errors",
    "account_of_files": "files.conversion",
    "convert": "conversion",
    "convert_library": "library.run",
    "export_conversion": "export.run",
    "load": "files.maps",
    "map_warnings": "suspicions",
    "mitsuba_dict": "export.mitsuba",
    "read_samples": "files.samples_json",
    "read_skylight": "export.skylight",
    "save": "files.conversion",
    "skylight_of": "export.skylight",
}

__all__ = [
    "Conversion",
    "ConversionSettings",
    "EnvironmentMap",
    "ExportSettings",
    "LibraryOptions",
    "LibraryResult",
    "SunsplitError",
    "account_of_files",
    "convert",
    "convert_library",
    "export_conversion",
    "load",
    "map_warnings",
    "mitsuba_dict",
    "read_samples",
    "read_skylight",
    "save",
    "skylight_of",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first used: enabling the add-on must not load scipy."""
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value
