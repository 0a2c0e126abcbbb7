"""Damaged files by the hundred thousand: each is read, or refused with one sentence.

    python -m tools.fuzz --count 100000 --seed 1 -o FOLDER

Small valid files of every kind (`fuzz_corpus`) are damaged (`fuzz_mutations`) and loaded in a
process with little memory and little time (`fuzz_worker`); one that dies is started again after
the file that killed it. Files of all failures are kept in FOLDER with what became of them. The
same seed makes the same files. Needs Linux, for the limits.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.fuzz_corpus import valid_files
from tools.fuzz_mutations import mutated

ROOT = Path(__file__).resolve().parent.parent

SECONDS, STARTING = 20, 120
"""That a file may take, and a worker to start on a busy machine."""

MEGABYTES = 2048
"""That a worker may have more than at its start."""

TURN = 5000
"""Files for each worker: what a library loses in each would add up."""


@dataclass(frozen=True)
class Result:
    """What became of a file. peak: most memory of its worker so far, in megabytes."""

    number: int
    outcome: str
    text: str = ""
    seconds: float = 0.0
    peak: int = 0

    @property
    def is_failure(self) -> bool:
        return self.outcome.startswith("FAILURE")


def main() -> int:
    options = _options()
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        corpus = valid_files(Path(folder))
        end = options.first + options.count
        for result in fuzz(options.seed, options.first, end, megabytes=options.megabytes):
            results.append(result)
            if result.is_failure:
                _keep(result, mutated(corpus, options.seed, result.number), options)
    print(table(results))
    print(f"seed {options.seed}, {len(corpus)} kinds, {time.monotonic() - start:.0f} s")
    return int(any(result.is_failure for result in results))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--megabytes", type=int, default=MEGABYTES, help="for each worker")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for failures")
    return parser.parse_args()


def fuzz(
    seed: int,
    first: int,
    end: int,
    worker: str = "tools.fuzz_worker",
    seconds: float = SECONDS,
    megabytes: int = MEGABYTES,
) -> Iterator[Result]:
    """Results of the files from `first` to before `end`, in order, one process at a time.

    worker: the module that reads them. seconds: that it may take for each.
    megabytes: that it may have more than at its start.
    Raises RuntimeError when it does not start.
    """
    while first < end:
        numbers = range(first, min(first + TURN, end))
        for result in _turn(seed, numbers, [sys.executable, "-m", worker], seconds, megabytes):
            yield result
            first = result.number + 1


def table(results: list[Result]) -> str:
    """Outcomes, most frequent first, and the extremes."""
    counts = Counter(result.outcome for result in results)
    lines = [f"{count:8,d}  {outcome}" for outcome, count in counts.most_common()]
    slowest = max(results, key=lambda result: result.seconds)
    largest = max(results, key=lambda result: result.peak)
    lines.append(f"slowest: file {slowest.number}, {slowest.seconds:.2f} s")
    lines.append(f"most memory: file {largest.number}, {largest.peak} MB")
    return "\n".join(lines)


def _turn(
    seed: int, files: range, command: list[str], seconds: float, megabytes: int
) -> Iterator[Result]:
    """Results until the worker has ended, whether well or not."""
    with tempfile.TemporaryDirectory() as folder:
        read, write = os.pipe()
        numbers = map(str, (seed, files.start, files.stop, write))
        worker = subprocess.Popen(
            [*command, *numbers, folder, str(megabytes)],
            cwd=ROOT,
            pass_fds=[write],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        os.close(write)
        number = files.start
        try:
            lines = _lines(read, seconds)
            started = next(lines, None) is not None
            for line in lines if started else ():
                if line is None:
                    yield Result(number, "FAILURE: too long", seconds=seconds)
                    return
                result = Result(*json.loads(line))
                number = result.number + 1
                yield result
            status = worker.wait(STARTING)
        finally:
            os.close(read)
            worker.kill()
            _, said = worker.communicate()
        if not started:
            raise RuntimeError(f"the worker did not start:\n{said}")
        if number in files:
            reason = signal.Signals(-status).name if status < 0 else f"exit status {status}"
            yield Result(number, f"FAILURE: {reason}", said)


def _lines(descriptor: int, seconds: float) -> Iterator[bytes | None]:
    """Whole lines as they come, the first of which may take longer; None where none has come."""
    begun, patience = b"", float(STARTING)
    while select.select([descriptor], [], [], patience)[0]:
        patience = seconds
        new = os.read(descriptor, 1 << 16)
        if not new:
            return
        *lines, begun = (begun + new).split(b"\n")
        yield from lines
    yield None


def _keep(result: Result, content: bytes, options: argparse.Namespace) -> None:
    name = f"{options.seed}.{result.number}"
    (options.output / f"{name}.any").write_bytes(content)
    (options.output / f"{name}.txt").write_text(f"{result.outcome}\n{result.text}\n")
    print(f"{name}: {result.outcome}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
