"""Portals change the noise of a room and nothing of its light."""

from __future__ import annotations

import bpy
import pytest

from tests.blender import write_map
from tests.maps import direction, paint_disc, sky
from tests.render.compare import estimate, means_agree
from tests.rooms import portals, room


@pytest.fixture(scope="module")
def overcast(tmp_path_factory):
    """A sky that is brighter above, with a sun before the window."""
    pixels = sky(256, 0.4)
    pixels[:64] += 1.0
    paint_disc(pixels, direction(25, 40), 4, (60, 60, 60))
    return write_map(tmp_path_factory.mktemp("maps") / "overcast.exr", pixels)


def test_the_light_is_that_of_the_map_and_the_noise_far_less(overcast, tmp_path):
    scene = room(overcast, size=24)
    plain = estimate(scene, tmp_path, samples=1024)
    bpy.ops.sunsplit.convert()
    (portal,) = portals(scene)
    told = estimate(scene, tmp_path, samples=512)
    means_agree(plain, told, tmp_path, limit=0.006)
    portal.hide_render = True
    untold = estimate(scene, tmp_path, samples=512)
    # Three times less variance, a picture by hand had: four seeds tell it from half of that.
    assert (untold.error**2).mean() > 1.5 * (told.error**2).mean()


def test_a_portal_over_half_of_a_window_is_noisier_and_as_bright(overcast, tmp_path):
    """What is missed of an opening is found by rays of their own."""
    scene = room(overcast, size=24)
    bpy.ops.sunsplit.convert()
    (portal,) = portals(scene)
    whole = estimate(scene, tmp_path, samples=1024)
    portal.data.size /= 2
    half = estimate(scene, tmp_path, samples=1024)
    means_agree(whole, half, tmp_path, limit=0.006)
    assert (half.error**2).mean() > 1.5 * (whole.error**2).mean()
