"""`sunsplit library` on the command line; what it says is in `library.telling`.

Exit status: 0 all maps are converted, 1 some are not, or none could be begun with; 2 wrong usage;
130 cancelled. In each case what was converted stays, and the same command goes on from there.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from . import interrupts
from .cli_settings import add_settings, settings_from
from .library.options import LARGEST, Assets, LibraryOptions
from .library.sizes import size_name, width_of

if TYPE_CHECKING:  # imported where they are used: `--help` must not wait for them
    from .library.events import Event


def add_library(verb: argparse.ArgumentParser) -> None:
    """The arguments of `sunsplit library`."""
    verb.add_argument("library", type=Path, metavar="FOLDER", help="where the maps are")
    verb.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT", help="where results go"
    )
    _add_choice(verb.add_argument_group("which maps"))
    _add_work(verb.add_argument_group("the work"))
    add_settings(verb)
    verb.add_argument("--preview", action="store_true", help="also write <name>.preview.png")
    _add_assets(verb.add_argument_group("an asset library for Blender"))
    verb.set_defaults(run=run_library)


def _add_choice(group: argparse._ArgumentGroup) -> None:
    for name, what in (
        ("include", "take only what is named like this (default: *.exr and *.hdr)"),
        ("exclude", "leave out what is named like this"),
    ):
        group.add_argument(
            f"--{name}",
            action="append",
            default=[],
            metavar="PATTERN",
            help=f'{what}; with a slash it is for the path, as in "studio/*"; more than once',
        )
    group.add_argument(
        "--allow-ldr", action="store_true", help="take 8 and 16 bit images too, as sRGB"
    )
    group.add_argument(
        "--sizes",
        type=_sizes,
        default=(),
        metavar="SIZES",
        help="write each map in these widths, such as 1k,4k, or in all that there are files of "
        "(default: once)",
    )
    group.add_argument(
        "--largest",
        type=_width,
        default=LARGEST,
        metavar="SIZE",
        help="of several sizes of a map, look at the largest up to this width (default: "
        f"{size_name(LARGEST)})",
    )


def _add_work(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--workers",
        type=_count,
        metavar="N",
        help="processes that convert, as far as memory allows (default: one for each core)",
    )
    group.add_argument(
        "--memory",
        type=_memory,
        metavar="SIZE",
        help="that all processes may take together, such as 8G (default: three quarters of what "
        "is free)",
    )
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="let the workers of a Dask cluster convert, such as tcp://10.0.0.1:8786; FOLDER and "
        "OUT are shared with them under the same paths",
    )
    group.add_argument(
        "--dry-run", action="store_true", help="say what would be done, and write nothing"
    )
    group.add_argument(
        "--json", action="store_true", help="print a line of JSON for each map, and one at the end"
    )


def _add_assets(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--assets",
        choices=get_args(Assets),
        help="make assets of skies, with previews: a .blend file for each map, or one for all",
    )
    group.add_argument("--pack", action="store_true", help="put images into the .blend files")
    group.add_argument(
        "--blender",
        metavar="PROGRAM",
        help="the Blender that makes them (default: this one, or the one that is installed)",
    )


def run_library(options: argparse.Namespace) -> int:
    from .library.events import AssetSettled
    from .library.planned import plan_library
    from .library.run import convert_library
    from .library.telling import say_end, say_notice, say_plan, telling

    chosen = LibraryOptions(
        settings=settings_from(options),
        preview=options.preview,
        allow_ldr=options.allow_ldr,
        include=tuple(options.include),
        exclude=tuple(options.exclude),
        sizes=options.sizes,
        largest=options.largest,
        assets=options.assets,
        pack=options.pack,
    )
    if options.dry_run:
        say_plan(plan_library(options.library, options.output, chosen), options.json)
        return 0
    begun, settled = time.monotonic(), 0
    with telling(options.json) as tell:

        def listen(event: Event) -> None:
            nonlocal settled
            if not isinstance(event, AssetSettled):
                settled = event.number
            interrupts.check()
            tell(event)

        try:
            result = convert_library(
                options.library,
                options.output,
                chosen,
                workers=options.workers,
                memory=options.memory,
                scheduler=options.scheduler,
                blender=options.blender or options.own_blender,
                listen=listen,
                notice=say_notice,
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"{settled:,} maps are done; run the same again to go on"
            ) from None
    say_end(result, time.monotonic() - begun, options.json)
    return 0 if result.is_well else 1


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 1 up")
    return int(text)


def _width(text: str) -> int:
    width = width_of(text)
    if width is None or width < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is no width such as 4k or 4096")
    return width


def _sizes(text: str) -> object:
    return "all" if text == "all" else tuple(_width(part) for part in text.split(","))


def _memory(text: str) -> int:
    from .library.memory import parse_memory
    from .settings import BadSetting

    try:
        return parse_memory(text)
    except BadSetting as error:
        raise argparse.ArgumentTypeError(str(error)) from error
