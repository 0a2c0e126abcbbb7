"""README's first command, small: it must not rot."""

from __future__ import annotations

import subprocess
import sys

from tests.conftest import ROOT


def test_the_demo(tmp_path):
    few = ["--samples", "2", "--width", "64", "-o", str(tmp_path)]
    command = [sys.executable, str(ROOT / "tools" / "demo.py"), *few]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    assert "3. Result" in done.stdout
    made = {path.name for path in tmp_path.iterdir()}
    assert made >= {"before.png", "after.png", "converted.blend", "before, after, difference.png"}
