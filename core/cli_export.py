"""`sunsplit export` on the command line."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from .export.settings import LUMENS_PER_WATT, Discs, ExportSettings, Format, Reader, Up

if TYPE_CHECKING:  # imported where it is used: `--help` must not wait for scipy
    from .export.run import ExportedFiles


def add_export(verb: argparse.ArgumentParser) -> None:
    """The arguments of `sunsplit export`."""
    verb.add_argument(
        "conversion", type=Path, metavar="CONVERSION", help="a <name>.lights.json of `convert`"
    )
    verb.add_argument("--format", choices=get_args(Format), required=True, help="whose files")
    verb.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: here"
    )
    verb.add_argument(
        "--up",
        choices=get_args(Up),
        default="usual",
        help="the axis that points up (default: what is usual there)",
    )
    verb.add_argument(
        "--discs",
        choices=get_args(Discs),
        default="auto",
        help="what becomes of suns with a width where the format has no such lights: many narrow "
        "lights, or discs in the map (default: the former for narrow suns, the latter for wide)",
    )
    verb.add_argument(
        "--lux",
        type=float,
        default=LUMENS_PER_WATT,
        help="of glTF, for a unit of irradiance (default: 683, lumens of a watt; 1 for viewers "
        "that take lux as a plain number)",
    )
    verb.add_argument(
        "--reader",
        choices=get_args(Reader),
        default="usdlux",
        help="of USD (default: usdlux, all that follow its specification; blender for Blender's "
        "own importer, which takes suns for four times as strong and twice as wide)",
    )
    verb.add_argument("--json", action="store_true", help="print the result as JSON")
    verb.set_defaults(run=run_export)


def run_export(options: argparse.Namespace) -> int:
    from .export.run import export_conversion

    settings = ExportSettings(
        options.format, options.up, options.discs, options.lux, options.reader
    )
    files = export_conversion(options.conversion, options.output, settings)
    try:
        print(json.dumps(_as_dict(files)) if options.json else "\n".join(_lines(files)))
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the files are written") from None
    return 0


def _lines(files: ExportedFiles) -> list[str]:
    return [f"axes: {files.axes}", *files.losses, *(f"wrote {path}" for path in files.paths)]


def _as_dict(files: ExportedFiles) -> dict[str, object]:
    return {
        "lights": str(files.lights),
        "scene": str(files.scene),
        "map": str(files.map) if files.map else None,
        "axes": files.axes,
        "losses": list(files.losses),
    }
