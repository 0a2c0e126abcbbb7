"""What `sunsplit library` says: lines, a bar on a terminal, or JSON for machines."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from .events import AssetSettled, Event, Listener
from .planned import LibraryPlan, Planned
from .run import LibraryResult

REPAINT = 0.5
"""Seconds between two paintings of the bar: time runs while a large map is converted."""


def say_plan(planned: LibraryPlan, as_json: bool) -> None:
    """Print what would be done."""
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
    return _line(f"{file.path}, {size}{more}: {'done' if each.row else 'to do'}: {names}")


@contextmanager
def telling(as_json: bool) -> Iterator[Listener]:
    """What to do about each map that is settled."""
    if as_json:
        yield lambda event: print(json.dumps(_settled_as_dict(event)), flush=True)
    elif sys.stderr and sys.stderr.isatty():
        with _bar() as tell:
            yield tell
    else:
        yield _tell_by_line


def _settled_as_dict(event: Event) -> dict[str, Any]:
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
    if isinstance(event, AssetSettled):
        return _line(f"sunsplit: {event.blend}: {event.sentence}") if event.sentence else ""
    row = event.row
    return _line(f"sunsplit: {row.source}: {row.sentence}") if row.status == "failed" else ""


def _done(event: Event) -> str:
    if isinstance(event, AssetSettled):
        return _line(event.blend)
    row = event.row
    suns = "1 sun" if row.lights == 1 else f"{row.lights} suns"
    return _line(f"{row.source}: {suns} with {row.share:.1%} of all light, {row.seconds:.1f} s")


def _line(text: str) -> str:
    """A file's name may hold line feeds and what moves a terminal's cursor."""
    return re.sub(r"[\x00-\x1f\x7f-\x9f]", "?", text)


def say_notice(sentence: str) -> None:
    """Print a sentence about a cluster."""
    from tqdm import tqdm

    tqdm.write(f"sunsplit: {sentence}", file=sys.stderr)  # above the bar, where there is one
    sys.stderr.flush()


@contextmanager
def _bar() -> Iterator[Listener]:
    """A bar on a terminal, with time left and maps a minute."""
    from tqdm import tqdm

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


def say_end(result: LibraryResult, seconds: float, as_json: bool) -> None:
    """Print what all came to."""
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
