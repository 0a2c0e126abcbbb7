"""The command line: `sunsplit convert` and `sunsplit info`. Needs no Blender.

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
from .errors import SunsplitError
from .progress import Progress, terminal_progress

if TYPE_CHECKING:  # imported where they are used: `--help` must not wait for scipy
    from .conversion import Conversion
    from .files.conversion import WrittenFiles

CANCELLED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit status."""
    try:
        _print_any_name()
        with interrupts.remembered():
            status = _run(arguments)
        # Here, where a reader that has left can be told from an error; not when Python ends.
        if sys.stdout:
            sys.stdout.flush()
        return status
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


def _run(arguments: Sequence[str] | None) -> int:
    try:
        options = _parser().parse_args(arguments)
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
        print(f"sunsplit {_version()}")
        parser.exit()


def _version() -> str:
    """From the add-on's manifest; a package that pip has installed has metadata instead."""
    import tomllib
    from importlib import metadata

    manifest = Path(__file__).parent.parent / "blender_manifest.toml"
    try:
        return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
    except FileNotFoundError:
        return metadata.version("sunsplit")


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
    convert.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="DIR", help="default: here"
    )
    convert.add_argument(
        "--lights", type=_count, default=16, metavar="N", help="at most N suns (default: 16)"
    )
    convert.add_argument(
        "--share",
        type=_share,
        default=None,
        metavar="X",
        help="part of all light in the bright region, above 0 up to 1 (1: no residual), "
        "or auto (default): whole peaks with their halo",
    )
    convert.add_argument(
        "--strata", type=_strata, default=2, metavar="N", help="strata of luminance (default: 2)"
    )
    convert.add_argument("--residual", choices=("map", "none"), default="map")
    convert.add_argument(
        "--residual-width",
        type=_count,
        metavar="PIXELS",
        help="a whole part of the map's width (default: the map's own)",
    )
    convert.add_argument("--preview", action="store_true", help="also write <name>.preview.png")
    convert.add_argument("--json", action="store_true", help="print the result as JSON")
    convert.set_defaults(run=run_convert)
    info = verbs.add_parser("info", help="say what an HDRI holds, write nothing")
    _add_map(info)
    info.add_argument("--json", action="store_true", help="print the result as JSON")
    info.set_defaults(run=run_info)
    return parser


def _add_map(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("map", type=Path, metavar="HDRI", help="an equirectangular .exr or .hdr")
    verb.add_argument(
        "--allow-ldr", action="store_true", help="take 8 and 16 bit images too, as sRGB"
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 1 up")
    return int(text)


def _strata(text: str) -> int:
    if not text.isdecimal() or int(text) < 2 or int(text) % 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not an even number from 2 up")
    return int(text)


def _share(text: str) -> float | None:
    if text == "auto":
        return None
    try:
        share = float(text)
    except ValueError:
        share = 0.0
    if not 0 < share <= 1:
        raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor above 0 up to 1")
    return share


def run_convert(options: argparse.Namespace) -> int:
    from .conversion import convert
    from .files.conversion import save
    from .files.maps import load
    from .report import conversion_lines
    from .settings import ConversionSettings

    settings = ConversionSettings(
        lights=options.lights,
        share=options.share,
        strata=options.strata,
        residual=options.residual if options.share != 1 else "none",
        residual_width=options.residual_width,
    )
    with terminal_progress() as progress:
        progress("reading", 0.0)
        environment = load(options.map, options.allow_ldr)
        conversion = convert(environment, settings, _within(progress, 0.3, 0.8))
        progress("writing", 0.8)
        files = save(conversion, options.output, options.preview)
    try:
        if options.json:
            _print_json(conversion, files)
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
        progress("reading", 0.0)
        environment = load(options.map, options.allow_ldr)
        conversion = convert(
            environment, ConversionSettings(residual="none"), _within(progress, 0.3, 1.0)
        )
    print(json.dumps(describe(conversion)) if options.json else "\n".join(info_lines(conversion)))
    return 0


def _within(progress: Progress, start: float, end: float) -> Progress:
    """A listener for a part of the whole work."""
    return lambda stage, fraction: progress(stage, start + (end - start) * fraction)


def _print_json(conversion: Conversion, files: WrittenFiles) -> None:
    from .files.conversion import describe

    paths = {
        kind: str(path) if path else None
        for kind, path in (
            ("lights", files.lights),
            ("residual", files.residual),
            ("preview", files.preview),
        )
    }
    print(json.dumps(describe(conversion) | {"files": paths}))
