"""What EEVEE needs to show a conversion's lamps as they are, and the scene as it was before.

By itself EEVEE looks for what is before a soft light in six places of the way to it, keeps maps as
sharp as for a hard light for each lamp until there is no room for more, and cuts off light of the
world that it takes for noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

CASTERS = ("MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD")
"""Types of things that cast shadows."""

STEPS = 16
"""Places at which EEVEE looks for what is before a lamp: as many as it can. A picture lit by wide
lamps was wrong by 14 % with six, by 8 % with sixteen, by 3 % with jitter."""

TEXELS = 2048
"""Of a lamp's shadow map along the way through the scene, as the tangent of the lamp's half-angle
counts them. EEVEE traces no wider than its map reaches, so maps of wide lamps must be coarse: a
lamp's disc is all traced, and its penumbrae hide the texels."""

FINEST, COARSEST = 0.001, 0.1
"""Metres of a texel: Blender's default, and where shadows would begin too far from their things."""

JITTERED = np.radians(3), np.radians(50)
"""Widths of lamps that jitter makes truer. What is before narrower ones is found well enough in one
map. Of wider ones much is below the horizons of surfaces, which then lie in their own shadow in a
part of the samples, though EEVEE has left that part of the lamp out already: white plates under an
even sky of 21 such lamps were up to 7 % too dark, 2 % without. Shadows alone would have jitter up
to 60 degrees: a scene under Blender's interior light is wrong by 1.0 with it, not by 1.5 %."""

OVERBLUR = 10.0
"""Percent of a disc that is traced around each place on it: Blender's default."""

BRIGHTEST = 65_504
"""EEVEE keeps the world in half floats."""

MEGABYTES = 25
"""Of shadow maps that a lamp takes, sharp ones too, as measured with 32 of them."""


def apply(scene: bpy.types.Scene, lamps: Sequence[bpy.types.Object]) -> None:
    """Set up a scene and a conversion's lamps, once; `take_back` puts the scene's settings back."""
    settings, before = scene.eevee, scene.sunsplit.before_eevee
    before.use_shadows = settings.use_shadows
    before.shadow_steps = settings.shadow_step_count
    before.shadow_pool = settings.shadow_pool_size
    before.clamp_indirect = settings.clamp_surface_indirect
    before.is_set = True
    settings.use_shadows = True
    settings.shadow_step_count = max(STEPS, settings.shadow_step_count)
    settings.shadow_pool_size = _pool(settings, len(lamps))
    # It would cut off the light of a bright world, which Cycles does not do.
    settings.clamp_surface_indirect = 0.0
    width = _extent(scene)
    for lamp in lamps:
        _set_shadow(lamp.data, width)


def take_back(scene: bpy.types.Scene) -> None:
    """The scene's settings as they were before `apply`; nothing to do where it was not called."""
    settings, before = scene.eevee, scene.sunsplit.before_eevee
    if not before.is_set:
        return
    settings.use_shadows = before.use_shadows
    settings.shadow_step_count = before.shadow_steps
    settings.shadow_pool_size = before.shadow_pool
    settings.clamp_surface_indirect = before.clamp_indirect
    before.is_set = False


def losses(residual: NDArray[np.float32] | None, gain: NDArray[np.float64]) -> list[str]:
    """What EEVEE's world cannot hold, a sentence or none.

    residual: radiance, (height, width, 3). gain: from it to the scene's, (3,).
    """
    if residual is None or (residual.max(axis=(0, 1)) * gain).max() <= BRIGHTEST:
        return []
    return [
        f"The world is brighter than {BRIGHTEST:,} in places, which EEVEE cuts off: a larger "
        "share, or an automatic one, makes lamps of it."
    ]


def target_for(target: str, engine: str) -> str:
    """What "auto" stands for under a render engine; other targets are what they are."""
    if target != "auto":
        return target
    return "eevee" if "EEVEE" in engine else "cycles"


def _set_shadow(lamp: bpy.types.Light, width: float) -> None:
    """Nothing left to chance, as of the rest of a lamp's properties."""
    texel = float(np.tan(min(lamp.angle, np.radians(170)) / 2)) * width / TEXELS
    lamp.use_shadow = True
    lamp.shadow_maximum_resolution = float(np.clip(texel, FINEST, COARSEST))
    lamp.shadow_filter_radius = 1.0
    # In renders, not in viewports: the map is drawn again for each sample, from anew on the disc.
    lamp.use_shadow_jitter = bool(JITTERED[0] < lamp.angle < JITTERED[1])
    lamp.shadow_jitter_overblur = OVERBLUR


def _pool(settings: bpy.types.SceneEEVEE, lamps: int) -> str:
    """The smallest pool that these lamps' maps fit into, at least the one that there is."""
    sizes = settings.bl_rna.properties["shadow_pool_size"].enum_items.keys()
    wanted = max(lamps * MEGABYTES, int(settings.shadow_pool_size))
    fitting = [size for size in sizes if int(size) >= wanted]
    return min(fitting or [max(sizes, key=int)], key=int)


def _extent(scene: bpy.types.Scene) -> float:
    """The diagonal of what may cast shadows, in metres; 0 of nothing."""
    corners = [
        thing.matrix_world @ Vector(corner)
        for thing in scene.objects
        if thing.type in CASTERS and not thing.hide_render
        for corner in thing.bound_box
    ]
    return float(np.linalg.norm(np.ptp(np.array(corners), axis=0))) if corners else 0.0
