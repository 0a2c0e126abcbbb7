"""`blender --command sunsplit library`, as a user of the installed extension types it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess

from tests.conftest import ROOT
from tests.gui.window import WITH_US, Window

MAP = ROOT / "sample_scenes" / "spruit_sunrise_1k.hdr"

WITH_PROC = ("unshare", "--mount", "sh", "-c", 'mount -t proc proc "$0"/proc && exec "$@"')
"""Programs want to know what memory there is; nobody else sees this mount."""


def test_a_library_is_converted_and_becomes_assets(window: Window):
    debian, folder = window.debian, window.folder
    maps, out = folder / "maps", folder / "converted"
    (maps / "morning").mkdir(parents=True)
    shutil.copy(MAP, maps / "morning" / "sunrise.hdr")
    (maps / "bad.hdr").touch()
    window.ask("bpy.ops.wm.save_userpref() and None")  # what is installed is there next time, too
    words = ("blender", "--command", "sunsplit", "library", debian.inside(maps))
    words += ("-o", debian.inside(out), "--assets", "each", "--json")
    done = subprocess.run(
        [*WITH_US, *WITH_PROC, os.fspath(debian.root), *debian.command(*words)],
        capture_output=True,
        text=True,
        timeout=300,
        env=debian.environment(debian.inside(folder)),
    )
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert done.returncode == 1, done.stdout + done.stderr
    assert [line["event"] for line in lines] == ["map", "map", "asset", "end"]
    assert {line["source"]: line["status"] for line in lines[:2]} == {
        "morning/sunrise.hdr": "done",
        "bad.hdr": "failed",
    }
    assert lines[2]["sentence"] == ""
    made = {path.name for path in (out / "morning").iterdir()}
    assert made == {"sunrise.blend", "sunrise.lights.json", "sunrise.residual.exr"}
    assert (out / "report.html").is_file()
