"""Builds the extension: one zip for each Blender and platform, with all the wheels it needs.

    python tools/build_extension.py [--blender 4.5|5.2] [--platform NAME|host] [--python 3.N]
                                    [-o DIR]

Needs the development environment (`uv sync --extra blender`): uv tells which wheels uv.lock asks
for, pip downloads them, and the builder and validator that Blender ships make the zip. Either
Blender builds the zips for both. Wheels are kept in `wheels/` and checked against the hashes in
uv.lock; once all are there, nothing is downloaded.

numpy is left out: Blender has its own. OpenImageIO has no wheel for windows-arm64, and that zip
goes without it: inside Blender, maps are read through Blender's images, so converting a world
works all the same. Only `blender --command sunsplit` needs it, for maps other than .exr, and
finds it there if that Blender has OpenImageIO's Python module of its own. When any other wheel is
missing, its zip is skipped with a sentence on stderr, and the exit status is 1.

--python is for a Blender with another Python inside than blender.org builds it with, as Linux
distributions have. The zip's name then ends with that Python.

The zips need glibc 2.28 (as Blender does) or macOS 12 (as scipy's wheel does).
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from itertools import product
from pathlib import Path
from urllib.parse import unquote

from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags, mac_platforms
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"

SHIPPED = ("__init__.py", "LICENSE", "addon", "core")
"""What goes into a zip beside the manifest and the wheels. Stated, so that nothing slips in."""

BLENDERS_OWN = {"numpy"}
"""Packages that every Blender brings along: a second copy would be loaded beside the first."""

DISPENSABLE = {("openimageio", "windows-arm64")}
"""(package, platform) where a zip without the wheel still works; see above."""

PYTHONS = {"4.5": (3, 11), "5.2": (3, 13)}
"""The Python inside each Blender, as blender.org builds it."""


class CannotBuild(Exception):
    """Why there is no zip, in a sentence for whoever runs the script."""


@dataclass(frozen=True)
class Platform:
    """tags: platforms of wheels that run there, best first. markers: its environment markers."""

    tags: tuple[str, ...]
    markers: dict[str, str]


def _markers(system: str, sys_platform: str, machine: str) -> dict[str, str]:
    os_name = "nt" if sys_platform == "win32" else "posix"
    names = ("platform_system", "sys_platform", "platform_machine", "os_name")
    return dict(zip(names, (system, sys_platform, machine, os_name), strict=True))


PLATFORMS = {
    "linux-x64": Platform(
        (*(f"manylinux_2_{n}_x86_64" for n in range(28, 16, -1)), "manylinux2014_x86_64"),
        _markers("Linux", "linux", "x86_64"),
    ),
    "windows-x64": Platform(("win_amd64",), _markers("Windows", "win32", "AMD64")),
    "windows-arm64": Platform(("win_arm64",), _markers("Windows", "win32", "ARM64")),
    "macos-arm64": Platform(
        tuple(mac_platforms((12, 0), "arm64")), _markers("Darwin", "darwin", "arm64")
    ),
}
"""By Blender's names."""


@dataclass(frozen=True)
class Target:
    """What one zip is for. other_python: of a Blender that has not the Python of `PYTHONS`."""

    blender: str
    platform: str
    other_python: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"Blender {self.blender}{self._other(' with Python {}.{}')} on {self.platform}"

    @property
    def python(self) -> tuple[int, int]:
        return self.other_python or PYTHONS[self.blender]

    @property
    def suffix(self) -> str:
        """How the zip's name ends."""
        return f"blender{self.blender}-{self.platform}{self._other('-python{}.{}')}"

    def _other(self, text: str) -> str:
        return text.format(*self.other_python) if self.other_python else ""

    def needs(self, package: dict) -> bool:
        """Whether a package of the lock belongs there."""
        if package["name"] in BLENDERS_OWN:
            return False
        markers = PLATFORMS[self.platform].markers | {
            # Another Python gets wheels of the same versions: the lock knows only these Pythons.
            "python_version": "{}.{}".format(*PYTHONS[self.blender]),
            "python_full_version": "{}.{}.0".format(*PYTHONS[self.blender]),
            "implementation_name": "cpython",
            "platform_python_implementation": "CPython",
        }
        return "marker" not in package or Marker(package["marker"]).evaluate(markers)

    def wheel_tags(self) -> list[Tag]:
        """Tags of wheels that run there, best first: pip's order."""
        platforms, interpreter = PLATFORMS[self.platform].tags, "cp{}{}".format(*self.python)
        return [
            *cpython_tags(self.python, [interpreter], platforms),
            *compatible_tags(self.python, interpreter, platforms),
        ]


@dataclass(frozen=True)
class Wheel:
    """One file that uv.lock asks for."""

    package: str
    version: str
    file: str
    sha256: str

    def is_in(self, folder: Path) -> bool:
        """Whether a folder holds it, whole."""
        path = folder / self.file
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == self.sha256


def locked_packages() -> list[dict]:
    """What uv.lock has for the core: name, version, marker and wheels of each package.

    Raises CannotBuild.
    """
    # `./run` puts uv into .tools where there is none.
    uv = shutil.which("uv") or shutil.which("uv", path=ROOT / ".tools" / "bin")
    if uv is None:
        raise CannotBuild("uv is missing: install it first, it reads uv.lock.")
    options = ("--frozen", "--offline", "--no-dev", "--no-emit-project", "--no-header", "--quiet")
    command = [uv, "export", *options, "--format", "pylock.toml", "--project", str(ROOT)]
    return tomllib.loads(_run(command, "uv cannot read uv.lock"))["packages"]


def choose_wheels(packages: Sequence[dict], target: Target) -> list[Wheel]:
    """The best wheel of each package for a target. Raises CannotBuild when one has none."""
    ranks = {tag: rank for rank, tag in enumerate(target.wheel_tags())}
    wheels, lacking = [], []
    for package in packages:
        if not target.needs(package):
            continue
        fitting = []
        for entry in package.get("wheels", []):
            file = unquote(entry["url"].rpartition("/")[2])
            tags = [ranks[tag] for tag in parse_wheel_filename(file)[3] if tag in ranks]
            if tags:
                sha256 = entry["hashes"]["sha256"]
                wheel = Wheel(package["name"], package["version"], file, sha256)
                fitting.append((min(tags), wheel))
        if fitting:
            wheels.append(min(fitting, key=lambda choice: choice[0])[1])
        elif (package["name"], target.platform) in DISPENSABLE:
            print(f"The zip for {target} goes without {package['name']}: it has no wheel there.")
        else:
            lacking.append(f"{package['name']} {package['version']}")
    if lacking:
        raise CannotBuild(f"No zip for {target}: no wheel of {' and '.join(lacking)} runs there.")
    return wheels


def download(wheels: Sequence[Wheel], target: Target, folder: Path) -> None:
    """Bring what is missing or damaged into a folder. Raises CannotBuild."""
    missing = [wheel for wheel in wheels if not wheel.is_in(folder)]
    if not missing:
        return
    if importlib.util.find_spec("pip") is None:
        raise CannotBuild("pip is missing: run `uv sync --extra blender` first.")
    print(f"Downloading {len(missing)} wheels for {target}", flush=True)
    for wheel in missing:
        (folder / wheel.file).unlink(missing_ok=True)
    lines = [f"{w.package}=={w.version} --hash=sha256:{w.sha256}\n" for w in missing]
    with tempfile.TemporaryDirectory(prefix="sunsplit-") as temporary:
        wanted = Path(temporary) / "requirements.txt"
        wanted.write_text("".join(lines), encoding="utf-8")
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-input"]
        command += ["--disable-pip-version-check", "--no-deps", "--only-binary=:all:"]
        command += ["--require-hashes", "-r", str(wanted), "-d", str(folder)]
        command += ["--python-version", "{}.{}".format(*target.python)]
        for tag in PLATFORMS[target.platform].tags:
            command += ["--platform", tag]
        _run(command, f"The wheels for {target} cannot be downloaded")


def stage(target: Target, wheels: Sequence[Wheel], cache: Path, folder: Path) -> None:
    """Lay out in an empty folder what the zip for a target shall hold."""
    for name in SHIPPED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / name)
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy2(cache / wheel.file, folder / "wheels" / wheel.file)
    base = (ROOT / MANIFEST).read_text(encoding="utf-8")
    (folder / MANIFEST).write_text(manifest(base, target, wheels), encoding="utf-8")


def manifest(base: str, target: Target, wheels: Sequence[Wheel]) -> str:
    """The repository's manifest, narrowed down to one target. Raises CannotBuild."""
    major, minor = map(int, target.blender.split("."))
    lines = [
        f'blender_version_min = "{major}.{minor}.0"',
        # The first version that does not fit any more; its Python may be another one.
        f'blender_version_max = "{major}.{minor + 1}.0"',
        f'platforms = ["{target.platform}"]',
        "wheels = [",
        *(f'    "./wheels/{wheel.file}",' for wheel in wheels),
        "]",
    ]
    # The comment above the schema speaks of the repository's file.
    base = base[base.index("schema_version") :]
    text, count = re.subn(r"(?m)^blender_version_min = .*$", "\n".join(lines), base)
    if count != 1:
        raise CannotBuild(f"{MANIFEST} must state blender_version_min once.")
    return text


def blenders_builder() -> tuple[Path, Path]:
    """Blender's own builder and its list of known tags, from bpy, which is not imported.

    Raises CannotBuild.
    """
    try:
        folder = Path(str(distribution("bpy").locate_file("bpy")))
    except PackageNotFoundError:
        raise CannotBuild("bpy is missing: run `uv sync --extra blender` first.") from None
    for builder in folder.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"):
        return builder, builder.parents[3] / "modules/_bpy_internal/extensions/tags.py"
    raise CannotBuild("This bpy has no builder of extensions: take 4.5 or 5.2.")


def build(target: Target, packages: Sequence[dict], output: Path) -> Path:
    """Make and validate the zip for a target; its path. Raises CannotBuild."""
    cache = ROOT / "wheels"
    cache.mkdir(exist_ok=True)
    wheels = choose_wheels(packages, target)
    download(wheels, target, cache)
    builder, tags = blenders_builder()
    known = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    name = f"{known['id']}-{known['version']}-{target.suffix}.zip"
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="sunsplit-") as temporary:
        stage(target, wheels, cache, Path(temporary))
        command = [sys.executable, str(builder), "build", "--source-dir", temporary]
        command += ["--output-filepath", str(output / name), "--valid-tags", str(tags)]
        _run(command, f"Blender cannot build {name}")
    command = [sys.executable, str(builder), "validate", str(output / name)]
    _run([*command, "--valid-tags", str(tags)], f"Blender finds {name} invalid")
    return output / name


def _run(command: Sequence[str], failure: str) -> str:
    """Run a program; its output. Raises CannotBuild with the first error that it named."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stderr + done.stdout).strip().splitlines() or ["it gave no reason"]
        raise CannotBuild(f"{failure}: {next((s for s in said if 'error' in s.lower()), said[-1])}")
    return done.stdout


def host() -> str:
    """This machine's platform by Blender's name. Raises CannotBuild."""
    for name, known in PLATFORMS.items():
        same = (platform.system(), platform.machine().lower())
        if same == (known.markers["platform_system"], known.markers["platform_machine"].lower()):
            return name
    raise CannotBuild(f"There is no zip for this machine ({platform.platform()}).")


def _version(text: str) -> tuple[int, int]:
    major, minor = map(int, text.split("."))
    return major, minor


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--blender", action="append", choices=PYTHONS, help="default: all")
    parser.add_argument(
        "--platform", action="append", choices=[*PLATFORMS, "host"], help="default: all"
    )
    parser.add_argument("--python", type=_version, metavar="3.N", help="default: Blender's own")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist", metavar="DIR")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Build what was asked for; 0 when every zip is there."""
    chosen = _arguments(arguments)
    try:
        names = [host() if name == "host" else name for name in chosen.platform or PLATFORMS]
        packages = locked_packages()
    except CannotBuild as error:
        print(error, file=sys.stderr)
        return 1
    skipped = False
    for blender, name in dict.fromkeys(product(chosen.blender or PYTHONS, names)):
        try:
            path = build(Target(blender, name, chosen.python), packages, chosen.output)
            print(f"{path}  {path.stat().st_size / 1e6:.1f} MB", flush=True)
        except CannotBuild as error:
            print(error, file=sys.stderr)
            skipped = True
    return int(skipped)


if __name__ == "__main__":
    sys.exit(main())
