"""The zip as users get it: built, checked, and used in a Blender that has nothing else."""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tools import build_extension
from tools.build_extension import MANIFEST, PLATFORMS, PYTHONS, ROOT, SHIPPED, Target

BLENDER = ".".join(importlib.metadata.version("bpy").split(".")[:2])

BLENDER_NEEDS = (
    *("bpy", "numpy", "numpy.libs", "zstandard"),
    *("requests", "urllib3", "certifi", "idna", "charset_normalizer"),
    *("cattrs", "cattr", "attrs", "attr", "typing_extensions.py"),
)
"""Packages in this environment that a Blender has inside itself; the others are not for it."""


def run(command: list[str], **environment: str) -> str:
    """Run a program; all it said, which is also shown when it fails."""
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
        env=os.environ | environment,
    )
    if done.returncode != 0:
        pytest.fail(f"{' '.join(command)}\n{done.stdout}\n{done.stderr}")
    return done.stdout + done.stderr


def build(folder: Path, **environment: str) -> Path:
    """The zip for this machine and this Blender."""
    script = str(ROOT / "tools" / "build_extension.py")
    options = ["--blender", BLENDER, "--platform", "host", "-o", str(folder)]
    run([sys.executable, script, *options], **environment)
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("zips"))


@pytest.fixture(scope="session")
def names(package: Path) -> list[str]:
    with zipfile.ZipFile(package) as archive:
        return archive.namelist()


@pytest.fixture(scope="session")
def manifest(package: Path) -> dict:
    with zipfile.ZipFile(package) as archive:
        return tomllib.loads(archive.read(MANIFEST).decode())


@pytest.fixture(scope="session")
def session(package: Path, sunrise: Path, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What `session.py` saw in a Blender that has the extension and no other library."""
    folder = tmp_path_factory.mktemp("session")
    packages = folder / "packages"
    packages.mkdir()
    site = Path(str(importlib.metadata.distribution("bpy").locate_file("")))
    for name in BLENDER_NEEDS:
        if (site / name).exists():
            (packages / name).symlink_to(site / name)
    script = str(Path(__file__).parent / "session.py")
    arguments = [str(packages), str(package), str(sunrise), str(folder)]
    said = run(
        # -I and -S: neither this environment's packages nor its editable Sunsplit are in reach.
        [sys.executable, "-I", "-S", script, *arguments],
        BLENDER_USER_RESOURCES=str(folder / "user"),
    )
    report = folder / "report.json"
    assert report.exists(), said
    return json.loads(report.read_text(encoding="utf-8")) | {"folder": str(folder), "log": said}


def blenders_builder(*arguments: str) -> None:
    builder, tags = build_extension.blenders_builder()
    run([sys.executable, str(builder), *arguments, "--valid-tags", str(tags)])


# The zip


def test_blender_finds_the_zip_valid(package: Path):
    blenders_builder("validate", str(package))


def test_zip_is_named_after_what_it_is_for(package: Path, manifest: dict):
    host = build_extension.host()
    assert package.name == f"sunsplit-{manifest['version']}-blender{BLENDER}-{host}.zip"


def test_zip_holds_what_runs_and_nothing_else(names: list[str]):
    assert {name.partition("/")[0] for name in names} == {*SHIPPED, MANIFEST, "wheels"}
    code = [n for n in names if n.partition("/")[0] in ("addon", "core")]
    assert all(name.endswith(".py") for name in code)
    assert not [n for n in names if any(p.startswith(("__pycache__", ".")) for p in n.split("/"))]
    for folder in ("addon", "core"):
        on_disk = {p.relative_to(ROOT).as_posix() for p in (ROOT / folder).rglob("*.py")}
        assert on_disk <= set(code)


def test_zip_has_each_wheel_that_its_manifest_lists(names: list[str], manifest: dict):
    inside = {f"./{name}" for name in names if name.startswith("wheels/")}
    assert inside == set(manifest["wheels"])
    packages = {wheel.rpartition("/")[2].split("-")[0].lower() for wheel in inside}
    assert packages >= {"scikit_image", "scipy", "openexr", "openimageio", "pillow", "tqdm"}
    assert not packages & {"numpy", "bpy", "requests", "pytest", "ruff"}


def test_manifest_fits_this_blender_only(manifest: dict):
    major, minor = map(int, BLENDER.split("."))
    assert manifest["blender_version_min"] == f"{major}.{minor}.0"
    assert manifest["blender_version_max"] == f"{major}.{minor + 1}.0"
    assert manifest["platforms"] == [build_extension.host()]


def test_manifest_agrees_with_pyproject(manifest: dict):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert manifest["id"] == project["name"]
    assert manifest["version"] == project["version"]
    assert manifest["license"] == [f"SPDX:{project['license']}"]


def test_repository_built_as_it_is_holds_no_development_files(tmp_path: Path):
    """Blender's builder on the repository itself: the manifest's patterns exclude the rest."""
    target = tmp_path / "plain.zip"
    blenders_builder("build", "--source-dir", str(ROOT), "--output-filepath", str(target))
    with zipfile.ZipFile(target) as archive:
        assert {n.partition("/")[0] for n in archive.namelist()} == {*SHIPPED, MANIFEST}


def test_second_build_needs_no_network(package: Path, names: list[str], tmp_path: Path):
    again = build(tmp_path, PIP_NO_INDEX="1", UV_OFFLINE="1")
    with zipfile.ZipFile(again) as archive:
        assert sorted(archive.namelist()) == sorted(names)


# The choice of wheels, for machines that are not at hand


@pytest.mark.parametrize("platform", PLATFORMS)
@pytest.mark.parametrize("blender", PYTHONS)
def test_lock_has_wheels_for(blender: str, platform: str):
    wheels = build_extension.choose_wheels(
        build_extension.locked_packages(), Target(blender, platform)
    )
    packages = {wheel.package for wheel in wheels}
    assert packages >= {"scikit-image", "scipy", "openexr", "pillow", "tqdm"}
    assert ("openimageio" in packages) == (platform != "windows-arm64")
    assert ("colorama" in packages) == platform.startswith("windows")


@pytest.mark.parametrize("platform", PLATFORMS)
def test_another_python_gets_wheels_of_the_same_versions(platform: str):
    packages = build_extension.locked_packages()
    usual = build_extension.choose_wheels(packages, Target("5.2", platform))
    other = build_extension.choose_wheels(packages, Target("5.2", platform, (3, 14)))
    assert {(w.package, w.version) for w in other} == {(w.package, w.version) for w in usual}
    tags = {wheel.file.split("-")[-3] for wheel in other}
    assert "cp314" in tags
    assert "cp313" not in tags


def test_zip_for_another_python_says_so():
    target = Target("5.2", "linux-x64", (3, 14))
    assert target.suffix == "blender5.2-linux-x64-python3.14"
    assert Target("5.2", "linux-x64").suffix == "blender5.2-linux-x64"


def test_lacking_wheel_is_named():
    entry = {"url": "https://host/scipy-1.0-cp311-cp311-win_amd64.whl", "hashes": {"sha256": "0"}}
    packages = [{"name": "scipy", "version": "1.0", "wheels": [entry]}]
    assert build_extension.choose_wheels(packages, Target("4.5", "windows-x64"))
    with pytest.raises(build_extension.CannotBuild, match=r"scipy 1\.0"):
        build_extension.choose_wheels(packages, Target("4.5", "linux-x64"))


def test_damaged_wheel_does_not_count(tmp_path: Path):
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    wheel = build_extension.Wheel("scipy", "1.0", "scipy.whl", empty)
    assert not wheel.is_in(tmp_path)
    (tmp_path / "scipy.whl").touch()
    assert wheel.is_in(tmp_path)
    (tmp_path / "scipy.whl").write_text("cut off")
    assert not wheel.is_in(tmp_path)


# The extension in a Blender


def test_installs_and_enables(session: dict):
    assert session["install"]["result"] == ["FINISHED"], session["log"]
    assert all(session["install"]["present"].values())


def test_blender_reports_no_error(session: dict):
    """Blender prints an exception in an add-on, its own ones included, and goes on."""
    assert "Traceback" not in session["log"], session["log"]
    assert "Warning" not in session["log"], session["log"]


def test_enabling_imports_no_library(session: dict):
    heavy = {"scipy", "skimage", "OpenEXR", "OpenImageIO", "PIL"}
    assert not session["install"]["loaded_before"]
    assert not heavy & set(session["install"]["imported"])


def test_needs_neither_its_own_folder_nor_a_network(session: dict):
    """So it works where extensions may only be read; it is never online."""
    assert session["touched"] == []


def test_converts_a_world(session: dict):
    before, after = session["before"], session["convert"]
    assert after["result"] == ["FINISHED"], session["log"]
    assert before["lamps"] == []
    assert after["lamps"]
    for kind, lamp, energy in after["lamps"]:
        assert (kind, lamp) == ("LIGHT", "SUN")
        assert energy > 0
    assert after["world"] != before["world"]
    assert after["maps"] == before["maps"] + 1


def test_restores_the_world(session: dict):
    assert session["restore"] == {"result": ["FINISHED"], **session["before"]}


def test_disabled_leaves_nothing_in_blender(session: dict):
    assert not any(session["disabled"].values())


def test_enabled_again_converts_the_same(session: dict):
    assert all(session["enabled_again"].values())
    assert session["convert_again"] == session["convert"]


def test_converting_in_blender_does_without_openimageio(session: dict):
    """The zip for windows-arm64 has no OpenImageIO."""
    assert session["without_openimageio"] == session["convert"]


def test_command_line_of_the_extension_converts_a_file(session: dict):
    result = session["command_line"]
    assert result["status"] == 0, result["said"]
    stem = "spruit_sunrise_1k"
    assert result["files"] == [f"{stem}.lights.json", f"{stem}.preview.png", f"{stem}.residual.exr"]


def test_a_library_is_converted_by_workers_of_the_extension(session: dict):
    result = session["library"]
    assert result["status"] == 0, result["said"]
    stem = "spruit_sunrise_1k"
    assert result["files"] == [f"{stem}.lights.json", f"{stem}.residual.exr"]


def test_code_and_libraries_come_from_the_zip(session: dict):
    extensions = Path(session["folder"], "user", "extensions")
    assert not session["foreign_sunsplit"]
    for path in session["own_modules"].values():
        assert Path(path).is_relative_to(extensions / "user_default" / "sunsplit")
    assert {"scipy", "skimage", "OpenEXR", "OpenImageIO", "PIL"} <= set(session["libraries"])
    for path in session["libraries"].values():
        assert Path(path).is_relative_to(extensions / ".local")
