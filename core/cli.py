"""The command line: `sunsplit convert`, `info`, `figures`, `export` and `library`. Needs no
Blender.

Exit status: 0 done, 1 the input cannot be used or the output not written, 2 wrong usage,
130 cancelled.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from . import interrupts
from .cli_export import add_export
from .cli_library import add_library
from .cli_settings import (
    add_figure_settings,
    add_settings,
    figure_settings_from,
    settings_from,
)
from .errors import SunsplitError
from .progress import Progress, terminal_progress
from .settings import BadSetting

if TYPE_CHECKING:  # imported where they are used: `--help` must not wait for scipy
    from .files.conversion import WrittenFiles

WRONG_USAGE = 2
CANCELLED = 130


def main(arguments: Sequence[str] | None = None, blender: str | None = None) -> int:
    """Run one verb and return the exit status. blender: the program that this runs in, if any."""
    try:
        _print_any_name()
        with interrupts.remembered():
            status = _run(arguments, blender)
        # Here, where a reader that has left can be told from an error; not when Python ends.
        if sys.stdout:
            sys.stdout.flush()
        return status
    except BadSetting as error:
        return _fail(str(error), WRONG_USAGE)
    except SunsplitError as error:
        return _fail(str(error))
    except BrokenPipeError:
        # The reader of our output (head, less) has left; the files are written.
        _forget_stdout()
        return 0
    except OSError as error:
        # Reading and writing files raise errors of ours: this is stdout itself.
        _forget_stdout()
        return _fail(f"cannot print the result: {error.strerror or error}.")
    except MemoryError:
        return _fail("there is not enough memory for this map.")
    except KeyboardInterrupt as stop:
        return _fail(f"cancelled, {str(stop) or 'nothing was written'}.", CANCELLED)


def _run(arguments: Sequence[str] | None, blender: str | None) -> int:
    try:
        options = _parser().parse_args(arguments)
        options.own_blender = blender
    except SystemExit as end:  # argparse ends the program, and Blender with it
        return int(end.code or 0)
    return options.run(options)


def _fail(sentence: str, status: int = 1) -> int:
    print(f"sunsplit: {' '.join(sentence.split())}", file=sys.stderr)
    return status


def _print_any_name() -> None:
    """File names may hold what the terminal's encoding lacks: escape it, do not stop at it."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _forget_stdout() -> None:
    """Let Python's last flush go nowhere: it would fail again, and say so."""
    try:
        descriptor = sys.stdout.fileno()
    except (AttributeError, OSError):  # none, or one of Python's own
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


class _Version(argparse.Action):
    """Prints the version; looks it up only when asked, which `--help` need not wait for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from .version import version

        print(f"sunsplit {version()}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sunsplit", description="Split an HDRI into sun lamps and a calm residual map."
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show the version of Sunsplit and exit"
    )
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    convert = verbs.add_parser(
        "convert",
        help="write suns and residual map of an HDRI",
        description="Write <name>.lights.json and <name>.residual.exr (and a preview).",
    )
    _add_map(convert)
    _add_output(convert)
    add_settings(convert)
    convert.add_argument("--preview", action="store_true", help="also write <name>.preview.png")
    convert.add_argument("--json", action="store_true", help="print the result as JSON")
    convert.set_defaults(run=run_convert)
    info = verbs.add_parser("info", help="say what an HDRI holds, write nothing")
    _add_map(info)
    info.add_argument("--json", action="store_true", help="print the result as JSON")
    info.set_defaults(run=run_info)
    figures = verbs.add_parser(
        "figures",
        help="draw samples, cells and regions of an HDRI, as in the paper",
        description="Write <name>.figure1.png, .figure2.png and .figure3.png.",
    )
    _add_map(figures)
    _add_output(figures)
    add_figure_settings(figures)
    figures.add_argument("--json", action="store_true", help="print the result as JSON")
    figures.set_defaults(run=run_figures)
    add_export(
        verbs.add_parser(
            "export",
            help="write a conversion for another renderer",
            description="Write the suns and the map of a conversion as files of another renderer, "
            "to include in a scene, and a small scene that renders at once.",
        )
    )
    add_library(
        verbs.add_parser(
            "library",
            help="convert all HDRIs in a folder and the folders in it",
            description="Convert a folder of maps; what is done already is not done again.",
        )
    )
    return parser


def _add_map(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("map", type=Path, metavar="HDRI", help="an equirectangular .exr or .hdr")
    verb.add_argument(
        "--allow-ldr", action="store_true", help="take 8 and 16 bit images too, as sRGB"
    )


def _add_output(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: here"
    )


def run_convert(options: argparse.Namespace) -> int:
    from .conversion import convert
    from .files.conversion import save
    from .files.maps import load
    from .report import conversion_lines

    settings = settings_from(options)
    with terminal_progress() as progress:
        environment = load(options.map, options.allow_ldr, _within(progress, 0.0, 0.3))
        conversion = convert(environment, settings, _within(progress, 0.3, 0.8))
        progress("writing", 0.8)
        files = save(conversion, options.output, options.preview)
    try:
        if options.json:
            _print_json(files)
        else:
            print("\n".join(conversion_lines(conversion, files)))
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the files are written") from None
    return 0


def run_info(options: argparse.Namespace) -> int:
    from .conversion import convert
    from .files.conversion import describe
    from .files.maps import load
    from .report import info_lines
    from .settings import ConversionSettings

    with terminal_progress() as progress:
        environment = load(options.map, options.allow_ldr, _within(progress, 0.0, 0.3))
        conversion = convert(
            environment, ConversionSettings(residual="none"), _within(progress, 0.3, 1.0)
        )
    print(json.dumps(describe(conversion)) if options.json else "\n".join(info_lines(conversion)))
    return 0


def run_figures(options: argparse.Namespace) -> int:
    from .files.figures import draw_figures, save_figures
    from .files.maps import load

    settings = figure_settings_from(options)
    with terminal_progress() as progress:
        environment = load(options.map, options.allow_ldr, _within(progress, 0.0, 0.1))
        pictures = draw_figures(environment, settings, _within(progress, 0.1, 0.9))
        progress("writing", 0.9)
        paths = save_figures(pictures, environment.name, options.output)
    try:
        if options.json:
            print(json.dumps({"files": [str(path) for path in paths]}))
        else:
            print("\n".join(f"wrote {path}" for path in paths))
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the files are written") from None
    return 0


def _within(progress: Progress, start: float, end: float) -> Progress:
    """A listener for a part of the whole work."""
    return lambda stage, fraction: progress(stage, start + (end - start) * fraction)


def _print_json(files: WrittenFiles) -> None:
    from .files import lights_json

    paths = {
        kind: str(path) if path else None
        for kind, path in (
            ("lights", files.lights),
            ("residual", files.residual),
            ("samples", files.samples),
            ("preview", files.preview),
        )
    }
    document, _, _ = lights_json.read(files.lights)
    for name in ("format", "version", "axes"):
        del document[name]
    print(json.dumps(document | {"files": paths}))
