"""Suns become sun lamps in a collection of their own."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.environment import LUMINANCE_WEIGHTS
from ..core.suns import Sun
from .controls import SOFTNESS, STRENGTH, WARMTH
from .driven import Formula
from .rig import SKY, Rig, guards_of, rig_of, twins_of
from .trace import TAG, constant
from .world import WorldLight

COLLECTION = "Sunsplit Suns"

GUARDS = "Sunsplit Light Tree Guard"

TWINS = "Sunsplit Sun for Mirrors"

FARTHEST = 5.0
"""Where lamps stand, from the origin: apart, and out of the way. It matters to nothing but the eye,
as a sun shines from everywhere."""

LEAST_WHOLE = 0.01
"""Of all light: below, a lamp's name says tenths of a percent."""

LEAST = 1e-9
"""What a factor of 0 is to a lamp, as the logarithm of 0 is no exposure."""

WARMER = 2.15
"""What one step of warmth divides a colour temperature by: 6500 to 3000 K."""


def make_lamps(
    suns: Sequence[Sun],
    light: WorldLight,
    rig: Rig,
    world: bpy.types.World,
    unmet_width: float = 0.0,
) -> list[bpy.types.Object]:
    """One lamp for each sun, aimed and tinted as the world shows the map; in no collection yet.

    light: of `world`, the converted one: what it does to rays of each kind, its lamps do too.
    unmet_width: of the widest suns that surfaces' own rays need not meet, in radians.
    """
    lamps = []
    for sun in suns:
        data = lamp_data(sun.irradiance * light.gain, sun.angular_diameter)
        _follow_factors(data, rig.sky, light)
        lamp = bpy.data.objects.new(data.name, data)
        lamp[TAG] = True
        lamp.parent = rig.holder
        to_light = rig.from_map @ sun.to_light
        _aim(lamp, to_light)
        lamp.location = FARTHEST * to_light / np.linalg.norm(to_light)
        _set_visibility(lamp, world, sun.angular_diameter > unmet_width)
        lamps.append(lamp)
    return lamps


def collection_of(
    rig: Rig, lamps: Sequence[bpy.types.Object], name: str = COLLECTION
) -> bpy.types.Collection:
    """A new collection with lamps and what holds them; in no scene yet."""
    collection = bpy.data.collections.new(name)
    collection[TAG] = True
    for thing in (*rig_of(rig.sky), *lamps):
        collection.objects.link(thing)
    return collection


def name_lamps(
    suns: Sequence[Sun], lamps: Sequence[bpy.types.Object], rig: Rig, whole: float
) -> None:
    """Name lamps by rank and share of all light, and their rig, once older ones of these names are
    gone. whole: luminance of all light of the map, integrated over the sphere."""
    for empty in rig_of(rig.sky):
        empty.name = SKY
    for guard in guards_of(rig.sky):
        guard.name = guard.data.name = GUARDS
    for twin in twins_of(rig.sky):
        twin.name = twin.data.name = TWINS
    for rank, (sun, lamp) in enumerate(zip(suns, lamps, strict=True), start=1):
        share = float(sun.scalar_irradiance @ LUMINANCE_WEIGHTS) / whole
        percent = f"{share:.0%}" if share >= LEAST_WHOLE else f"{share:.1%}"
        lamp.name = lamp.data.name = f"Sun {rank} ({percent[:-1]} %)"


def lamp_data(irradiance: NDArray[np.float64], diameter: float) -> bpy.types.Light:
    """A sun lamp of this normal irradiance, (3,), and angular diameter; nothing left to chance."""
    data = bpy.data.lights.new("Sun", "SUN")
    data[TAG] = True
    strength = float(irradiance.max())
    data.energy = strength
    data.color = irradiance / strength if strength > 0 else (1, 1, 1)
    data.angle = diameter
    data.exposure = 0.0
    data.normalize = True
    data.use_temperature = False
    data.use_shadow = True
    data.diffuse_factor = data.specular_factor = data.transmission_factor = 1.0
    data.volume_factor = 1.0
    return data


def _follow_factors(data: bpy.types.Light, sky: bpy.types.Object, light: WorldLight) -> None:
    """Let a lamp follow what all suns are changed by, and the world's strength. What the user may
    want to set for one lamp, its strength and colour, stays free."""
    formula = Formula()
    strength = formula.property("OBJECT", sky, f'["{STRENGTH.name}"]')
    if light.strength is not None:
        now = float(constant(light.strength)[0])
        strength = f"{strength}*({formula.input(light.strength)})/{now!r}"
    formula.drive(data, "exposure", -1, f"log(max({strength},{LEAST}),2)", 0.0)
    warmth = formula.property("OBJECT", sky, f'["{WARMTH.name}"]')
    formula.drive(data, "use_temperature", -1, f"{warmth} != 0", False)
    formula.drive(data, "temperature", -1, f"6500*pow({WARMER},-{warmth})", 6500.0)
    if data.angle:
        data["measured_angle"] = data.angle
        angle = formula.property("LIGHT", data, '["measured_angle"]')
        softness = formula.property("OBJECT", sky, f'["{SOFTNESS.name}"]')
        formula.drive(data, "angle", -1, f"min({angle}*{softness},pi)", data.angle)


def _aim(lamp: bpy.types.Object, to_light: NDArray[np.float64]) -> None:
    """A sun lamp shines along its local -Z, so +Z looks at the light."""
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = Vector(to_light).to_track_quat("Z", "Y")


def _set_visibility(lamp: bpy.types.Object, world: bpy.types.World, is_met: bool) -> None:
    """The camera sees the sun in the original map, every other ray in the lamp: once each, but for
    what `singular` tells. is_met: by rays that go on from surfaces, besides being looked for."""
    lamp.visible_camera = False
    lamp.lightgroup = world.lightgroup
    if not hasattr(world, "cycles"):  # Cycles is switched off
        return
    # Without it no ray meets the disc, and a mirror shows no sun.
    lamp.data.cycles.use_multiple_importance_sampling = is_met
    lamp.data.cycles.max_bounces = world.cycles.max_bounces
    rays = world.cycles_visibility
    lamp.visible_diffuse = rays.diffuse
    lamp.visible_glossy = rays.glossy
    lamp.visible_transmission = rays.transmission
    lamp.visible_volume_scatter = rays.scatter


def remove_lamps(lamps: Sequence[bpy.types.Object]) -> None:
    """Remove lamps that no scene uses any more."""
    for lamp in lamps:
        data = lamp.data
        if lamp.users == 0:
            bpy.data.objects.remove(lamp)
            if data.users == 0:
                bpy.data.lights.remove(data)


def unlink_lamps(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection | None,
    lamps: Sequence[bpy.types.Object],
) -> None:
    """Take a conversion's lamps out of a scene, wherever the user has put them.

    What the user has put into the lamps' collection moves to the scene.
    """
    if collection is not None and collection.name in scene.collection.children:
        _move_out(scene, collection, lamps)
        scene.collection.children.unlink(collection)
    for holder in (scene.collection, *scene.collection.children_recursive):
        for lamp in lamps:
            if lamp.name in holder.objects:
                holder.objects.unlink(lamp)
    if collection is not None and collection.users == 0:
        bpy.data.collections.remove(collection)


def _move_out(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    lamps: Sequence[bpy.types.Object],
) -> None:
    for thing in collection.objects:
        if thing not in lamps and thing.name not in scene.collection.objects:
            scene.collection.objects.link(thing)
    for child in collection.children:
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)


def suns_that_are(
    state: bpy.types.PropertyGroup, which: str, limit: float
) -> list[bpy.types.Object]:
    """Lamps of a conversion, the brightest first: "all", the "brightest", or those that are "sharp"
    or "soft", narrower than a limit in radians or not."""
    lamps = [entry.lamp for entry in state.lamps if entry.lamp]
    if which == "brightest":
        return lamps[:1]
    if which in ("sharp", "soft"):
        return [lamp for lamp in lamps if (lamp.data.angle < limit) == (which == "sharp")]
    return lamps


def select_lamps(context: bpy.types.Context, lamps: Sequence[bpy.types.Object]) -> None:
    """Select these lamps and nothing else, the first of them the active one."""
    shown = context.view_layer.objects
    for thing in shown.selected:
        thing.select_set(False)
    lamps = [lamp for lamp in lamps if lamp.name in shown]
    for lamp in lamps:
        lamp.select_set(True)
    if lamps:
        shown.active = lamps[0]
