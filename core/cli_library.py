"""`sunsplit library` on the command line: what it is told, and what it says.

Exit status: 0 all maps are converted, 1 some are not, or none could be begun with; 2 wrong usage;
130 cancelled. In each case what was converted stays, and the same command goes on from there.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from . import interrupts
from .cli_settings import add_settings, settings_from
from .library.options import LARGEST, Assets, LibraryOptions
from .library.sizes import size_name, width_of

if TYPE_CHECKING:  # imported where they are used: `--help` must not wait for them
    from .library.events import Event, Listener
    from .library.planned import LibraryPlan, Planned
    from .library.run import LibraryResult

REPAINT = 0.5
"""Seconds between two paintings of the bar: time runs while a large map is converted."""


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
        _say_plan(plan_library(options.library, options.output, chosen), options.json)
        return 0
    begun, settled = time.monotonic(), 0
    with _telling(options.json) as tell:

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
                notice=_say_notice,
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(
                f"{settled:,} maps are done; run the same again to go on"
            ) from None
    _say_end(result, time.monotonic() - begun, options.json)
    return 0 if result.is_well else 1


def _say_plan(planned: LibraryPlan, as_json: bool) -> None:
    for each in planned.maps:
        if as_json:
            print(json.dumps(_planned_as_dict(each)))
        else:
            print(_planned_line(each))
    for sentence in planned.unread:
        print(f"sunsplit: {sentence}", file=sys.stderr)
    if not as_json:
        known = sum(each.row is not None for each in planned.maps)
        print(f"{len(planned.maps):,} maps, {known:,} of them already converted")


def _planned_as_dict(each: Planned) -> dict[str, Any]:
    return {
        "event": "plan",
        "source": each.map.file.path,
        "variants": [file.path for file in each.map.others],
        "width": each.map.file.width,
        "height": each.map.file.height,
        "outputs": [asdict(output) for output in each.map.outputs],
        "known": each.row is not None,
    }


def _planned_line(each: Planned) -> str:
    file, others = each.map.file, len(each.map.others)
    size = f"{file.width} x {file.height}" if file.width else "of unknown size"
    more = f", and {others} more size{'s' if others > 1 else ''}" if others else ""
    names = ", ".join(
        output.stem if output.folder == "." else f"{output.folder}/{output.stem}"
        for output in each.map.outputs
    )
    return f"{file.path}, {size}{more}: {'done' if each.row else 'to do'}: {names}"


@contextmanager
def _telling(as_json: bool) -> Iterator[Listener]:
    """What to do about each map that is settled."""
    if as_json:
        yield lambda event: print(json.dumps(_settled_as_dict(event)), flush=True)
    elif sys.stderr and sys.stderr.isatty():
        with _bar() as tell:
            yield tell
    else:
        yield _tell_by_line


def _settled_as_dict(event: Event) -> dict[str, Any]:
    from .library.events import AssetSettled

    if isinstance(event, AssetSettled):
        told = asdict(event)
        return {"event": "asset", "of": told.pop("total")} | told
    row = asdict(event.row)
    del row["thumbnail"]
    return {"event": "map", "known": event.known, "number": event.number, "of": event.total} | row


def _tell_by_line(event: Event) -> None:
    failure = _failure(event)
    if failure:
        print(failure, file=sys.stderr, flush=True)
    elif not event.known:
        print(f"{event.number}/{event.total} {_done(event)}", flush=True)


def _failure(event: Event) -> str:
    """The line for what went wrong; "" where nothing did."""
    from .library.events import AssetSettled

    if isinstance(event, AssetSettled):
        return f"sunsplit: {event.blend}: {event.sentence}" if event.sentence else ""
    row = event.row
    return f"sunsplit: {row.source}: {row.sentence}" if row.status == "failed" else ""


def _done(event: Event) -> str:
    from .library.events import AssetSettled

    if isinstance(event, AssetSettled):
        return event.blend
    row = event.row
    suns = "1 sun" if row.lights == 1 else f"{row.lights} suns"
    return f"{row.source}: {suns} with {row.share:.1%} of all light, {row.seconds:.1f} s"


def _say_notice(sentence: str) -> None:
    from tqdm import tqdm

    tqdm.write(f"sunsplit: {sentence}", file=sys.stderr)  # above the bar, where there is one
    sys.stderr.flush()


@contextmanager
def _bar() -> Iterator[Listener]:
    """A bar on a terminal, with time left and maps a minute."""
    from tqdm import tqdm

    from .library.events import AssetSettled

    form = "{desc} {percentage:3.0f} % |{bar}| {elapsed}, {remaining} left{postfix}"
    bar = tqdm(total=1.0, file=sys.stderr, bar_format=form, smoothing=0, leave=False)
    done, fresh, failed = threading.Event(), 0, 0

    def tell(event: Event) -> None:
        nonlocal fresh, failed
        failure, is_map = _failure(event), not isinstance(event, AssetSettled)
        fresh += is_map and not event.known
        failed += bool(failure)
        if failure:
            bar.write(failure, file=sys.stderr)
        fraction = event.fraction if is_map else event.number / event.total
        if event.known:
            bar.initial = fraction  # took no time, and tells nothing of the time left
        bar.n = fraction
        what, wrong = "maps" if is_map else "assets", f", {failed:,} failed" if failed else ""
        bar.set_description_str(f"{event.number:,} of {event.total:,} {what}{wrong}", refresh=False)
        elapsed = bar.format_dict["elapsed"]
        rate = f", {60 * fresh / max(elapsed, 1e-3):,.0f} maps/min" if is_map else ""
        bar.set_postfix_str(rate.removeprefix(", "), refresh=False)

    def paint() -> None:
        while not done.wait(REPAINT):
            bar.refresh()

    painter = threading.Thread(target=paint, daemon=True)
    painter.start()
    try:
        yield tell
    finally:
        done.set()
        painter.join()
        bar.close()


def _say_end(result: LibraryResult, seconds: float, as_json: bool) -> None:
    converted = len(result.rows) - len(result.failed) - result.known
    if as_json:
        counts = {
            "event": "end",
            "maps": len(result.rows),
            "converted": converted,
            "known": result.known,
            "failed": len(result.failed),
            "unread": list(result.unread),
            "assets": len(result.assets),
            "assets_failed": sum(bool(asset.sentence) for asset in result.assets),
            "seconds": seconds,
            "report": str(result.report),
        }
        print(json.dumps(counts))
        return
    for sentence in result.unread:
        print(f"sunsplit: {sentence}", file=sys.stderr)
    parts = [f"{converted:,} converted"]
    parts += [f"{result.known:,} had been converted before"] if result.known else []
    parts += [f"{len(result.failed):,} failed"] if result.failed else []
    print(f"{len(result.rows):,} maps: {', '.join(parts)}, in {seconds:,.1f} s")
    if result.assets:
        made = sum(not asset.known and not asset.sentence for asset in result.assets)
        wrong = sum(bool(asset.sentence) for asset in result.assets)
        parts = [f"{made:,} made"] + ([f"{wrong:,} with failures"] if wrong else [])
        print(f"{len(result.assets):,} asset files: {', '.join(parts)}")
    print(f"wrote {result.report}")


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
