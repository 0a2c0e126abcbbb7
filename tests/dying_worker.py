"""A worker of `tools.fuzz` that does what no file may make the real one do, as its number says."""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time

CRASHES, HANGS, LEAVES = 2, 4, 6


def main() -> None:
    first, end, descriptor = map(int, sys.argv[2:5])
    os.write(descriptor, b"ready\n")
    for number in range(first, end):
        if number == CRASHES:
            ctypes.string_at(0)
        elif number == HANGS:
            time.sleep(60)
        elif number == LEAVES:
            os._exit(3)
        os.write(descriptor, json.dumps([number, "read"]).encode() + b"\n")


if __name__ == "__main__":
    main()
