"""Reads damaged files one after the other and says what became of each: started by `tools.fuzz`.

    python -m tools.fuzz_worker SEED FIRST END DESCRIPTOR FOLDER MEGABYTES

What a library does to this process, a crash, an endless loop or all memory, is seen from outside.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import sys
import time
import traceback
from pathlib import Path

from tools.fuzz_corpus import valid_files
from tools.fuzz_mutations import mutated

SLOW = 6.0
"""Seconds of the processor for a small file that are too many. Repeating one pixel until it fills a
map of 8k takes 4."""

READY = "ready"
"""The first line: from here on time counts."""

LONGEST = 400
"""Characters of a sentence that one can still call a sentence."""


def main() -> None:
    seed, first, end, descriptor = map(int, sys.argv[1:5])
    folder = Path(sys.argv[5])
    corpus = valid_files(folder)
    _import_all(folder, corpus)
    _limit_memory(int(sys.argv[6]))
    said = folder / "said"
    _redirect_to(said)
    path = folder / "map.any"
    with os.fdopen(descriptor, "w") as reports:
        print(READY, file=reports, flush=True)
        for number in range(first, end):
            path.write_bytes(mutated(corpus, seed, number))
            start = time.process_time()
            outcome, text = _outcome(path)
            seconds = time.process_time() - start
            if seconds > SLOW:
                outcome = f"FAILURE: slow, and {outcome}"
            if said.stat().st_size:
                outcome, text = "FAILURE: printed", said.read_text(errors="replace")[:1000]
                os.truncate(said, 0)
            reports.write(json.dumps([number, outcome, text, seconds, _peak()]) + "\n")
            reports.flush()


def _import_all(folder: Path, corpus: list[bytes]) -> None:
    """Libraries are imported and have their memory before any file counts."""
    path = folder / "map.any"
    for content in corpus:
        path.write_bytes(content)
        _outcome(path)


def _limit_memory(megabytes: int) -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + megabytes * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _redirect_to(said: Path) -> None:
    """What anything prints, a C library too, goes into a file: nothing may."""
    file = os.open(said, os.O_CREAT | os.O_WRONLY | os.O_APPEND)
    os.dup2(file, 1)
    os.dup2(file, 2)


def _outcome(path: Path) -> tuple[str, str]:
    import numpy as np

    from sunsplit.core import load
    from sunsplit.core.errors import UnusableInput

    try:
        found = load(path, allow_ldr=True)
    except UnusableInput as error:
        sentence = str(error)
        whole = sentence.isprintable() and sentence.endswith(".") and len(sentence) < LONGEST
        return ("refused" if whole else "FAILURE: no sentence"), sentence
    except BaseException as error:
        return f"FAILURE: {type(error).__name__}", traceback.format_exc()
    light = found.radiance
    height = light.shape[0]
    good = light.dtype == np.float32 and light.shape == (height, 2 * height, 3)
    if not (good and np.isfinite(light).all() and (light >= 0).all() and light.any()):
        return "FAILURE: no map", f"{light.dtype} {light.shape}"
    if not all(text.isprintable() and len(text) < LONGEST for text in found.warnings):
        return "FAILURE: no sentence", repr(found.warnings)
    return "read", hashlib.sha256(light).hexdigest()


def _peak() -> int:
    """The most memory that this process has had, in megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10


if __name__ == "__main__":
    main()
