"""The validator that Khronos publishes for glTF, an npm package, by Node.js."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

from tests.installed import not_installed

PACKAGES = Path(__file__).parents[1] / ".tools" / "node" / "node_modules"
"""Where `npm install --prefix .tools/node gltf-validator@2.0.0-dev.3.10` puts it."""

SCRIPT = """
const validator = require(process.argv[1]);
const bytes = require("fs").readFileSync(process.argv[2]);
validator.validateBytes(new Uint8Array(bytes), {uri: process.argv[2], maxIssues: 0})
  .then((report) => console.log(JSON.stringify(report)));
"""

SEVERITIES = ("errors", "warnings", "information", "hints")


def validated(path: Path) -> dict[str, Any]:
    """The validator's report about a file. Skips the test where the validator is not installed."""
    node, package = shutil.which("node"), PACKAGES / "gltf-validator"
    if not node or not package.is_dir():
        not_installed("Node.js or the npm package gltf-validator is not installed.")
    command = [node, "-e", SCRIPT, str(package), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return json.loads(done.stdout)


def issues(report: dict[str, Any], *severities: str) -> list[str]:
    """What the validator found of these severities (all, by default), in its own words."""
    wanted = [SEVERITIES.index(severity) for severity in severities or SEVERITIES]
    return [
        f"{issue['code']} at {issue.get('pointer')}: {issue['message']}"
        for issue in report["issues"]["messages"]
        if issue["severity"] in wanted
    ]
