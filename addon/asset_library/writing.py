"""Skies become assets in .blend files: all of a file, or the older one stays."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import CannotWrite, SunsplitError, UnusableInput
from ...core.files.atomic import written_together
from ...core.library.catalogues import catalogue_id, catalogue_path, read_catalogues
from .job import AssetJob
from .picture import picture_of
from .sky import make_sky


def answer(entries: dict[str, Any]) -> dict[str, Any]:
    """Do a job: {"blend": the file, "sentence": "" or why it was not written, "left_out": for a
    file of several maps, a sentence for each that is not in it}.

    entries: of an `AssetJob`; or {"all": [those of several], "blend": the file of them all}.
    """
    blend = Path(entries["blend"])
    several = "all" in entries
    jobs = [AssetJob.of(one) for one in (entries["all"] if several else [entries])]
    try:
        left_out = write_assets(jobs, blend, several)
    except SunsplitError as error:
        return {"blend": str(blend), "sentence": str(error), "left_out": []}
    return {"blend": str(blend), "sentence": "", "left_out": left_out}


def write_assets(jobs: Sequence[AssetJob], blend: Path, leaves_out: bool = False) -> list[str]:
    """Write a .blend file with the assets of these maps; a sentence for each that was left out.

    leaves_out: maps that cannot be shown, as long as there are others. Whatever is open in this
    Blender is lost. Raises SunsplitError.
    """
    # The preferences stay: with new ones Blender would forget where libraries are.
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assets: set[bpy.types.ID] = set()
    left_out = []
    for job in jobs:
        try:
            assets |= _assets_of(job, blend.parent)
        except UnusableInput as error:
            if not leaves_out:
                raise
            left_out.append(f"{job.name}: {error}")
    if not assets:
        raise UnusableInput(" ".join(["There is no map to make assets of.", *left_out]))
    with written_together(blend.parent, [blend.name]) as (draft,):
        _write(draft, assets)
    return left_out


def _write(draft: Path, assets: set[bpy.types.ID]) -> None:
    try:
        # Paths are of the file's own place already, and not of the draft's.
        bpy.data.libraries.write(
            str(draft), assets, path_remap="NONE", fake_user=True, compress=True
        )
    except (OSError, RuntimeError) as error:
        raise CannotWrite(f"Blender cannot write the file: {error}") from error


def _assets_of(job: AssetJob, folder: Path) -> set[bpy.types.ID]:
    """A map's world and, if there are any, its suns. folder: where the file will lie."""
    sky = make_sky(job)
    picture = picture_of(sky, job.preview) if job.preview else None
    for image, file in sky.images.items():
        if job.pack:
            image.pack()
        image.filepath_raw = f"//{file.name}" if job.pack else _path_from(folder, file)
        image.buffers_free()
    assets = (sky.world, sky.collection) if sky.conversion.suns else (sky.world,)
    for asset in assets:
        _mark(asset, job, picture)
    return set(assets)


def _path_from(folder: Path, file: Path) -> str:
    """A file's path as Blender writes it, relative to the .blend; on another drive as it is."""
    try:
        relative = os.path.relpath(file.absolute(), folder.absolute())
    except ValueError:
        return str(file.absolute())
    return f"//{Path(relative).as_posix()}"


def _mark(asset: bpy.types.ID, job: AssetJob, picture: NDArray[np.float32] | None) -> None:
    asset.asset_mark()
    data = asset.asset_data
    for tag in job.tags:
        data.tags.new(tag, skip_if_exists=True)
    path = catalogue_path(job.catalogue)
    if path:
        data.catalog_id = catalogue_id(path, read_catalogues(job.root))
    data.author, data.license, data.copyright = job.author, job.licence, job.copyright
    data.description = job.description
    if picture is not None:
        preview = asset.preview_ensure()
        preview.image_size = job.preview, job.preview
        preview.image_pixels_float.foreach_set(picture)
