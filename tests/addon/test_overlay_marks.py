"""Where suns are on a screen, and what a click there hits."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from mathutils import Matrix, Vector

from sunsplit.addon.overlay.marks import (
    AROUND,
    Marks,
    circles,
    discs_in_map,
    marks_in_map,
    marks_in_view,
)
from sunsplit.addon.overlay.screen import (
    Frame,
    View,
    arrow_head,
    distances,
    globe,
    place_labels,
    ray_in_view,
)
from sunsplit.core import sphere
from tests.blender import fresh_scene
from tests.maps import direction

WIDTH, HEIGHT = 800, 600
FRAME = Frame(0, 0, WIDTH, HEIGHT)
LEAST = 9.0


def view_towards(looks: np.ndarray, field_of_view: float = 90.0, eye=(0, 0, 0)) -> View:
    """A perspective view; the angle in degrees is over the region's width."""
    turn = (-Vector(looks)).to_track_quat("Z", "Y").to_matrix().to_4x4()
    to_view = (Matrix.Translation(eye) @ turn).inverted()
    near, far, slope = 0.1, 1000.0, np.tan(np.radians(field_of_view) / 2)
    window = np.zeros((4, 4))
    window[0, 0], window[1, 1] = 1 / slope, WIDTH / HEIGHT / slope
    window[2, 2], window[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    window[3, 2] = -1
    return View(window @ np.array(to_view), WIDTH, HEIGHT, FRAME, True)


def orthographic_towards(looks: np.ndarray) -> View:
    to_view = (-Vector(looks)).to_track_quat("Z", "Y").to_matrix().to_4x4().inverted()
    window = np.diag([1 / 8, 1 / 6, -1 / 100, 1.0])
    return View(window @ np.array(to_view), WIDTH, HEIGHT, FRAME, False)


def marks_of(view: View, *discs: tuple[np.ndarray, float]) -> Marks:
    """Suns given by direction and diameter in degrees."""
    to_light = np.array([centre for centre, _ in discs])
    half = np.radians([diameter / 2 for _, diameter in discs])
    return marks_in_view(to_light, circles(to_light, half), view, LEAST)


# In perspective


@pytest.mark.parametrize("diameter", [4.0, 20.0, 60.0])
def test_a_disc_ahead_is_a_circle_of_its_true_size(diameter):
    marks = marks_of(view_towards(direction(30, 20)), (direction(30, 20), diameter))
    assert marks.place[0] == pytest.approx([WIDTH / 2, HEIGHT / 2], abs=1e-3)
    away = np.linalg.norm(marks.lines - marks.place[0], axis=-1)
    # A quarter turn across the width: tan 45 degrees is half of it.
    expected = WIDTH / 2 * np.tan(np.radians(diameter / 2))
    assert away == pytest.approx(expected, rel=1e-5)
    assert len(marks.lines) == AROUND - 1
    assert not marks.narrow[0]


@pytest.mark.parametrize("aside", [0.0, 17.0, 44.0])
def test_a_sun_aside_is_where_a_camera_sees_it(aside):
    marks = marks_of(view_towards(direction(30, 0)), (direction(30 - aside, 0), 0.5))
    x = WIDTH / 2 * (1 + np.tan(np.radians(aside)))
    assert marks.place[0] == pytest.approx([x, HEIGHT / 2], abs=1e-3)
    assert not marks.aside[0]


def test_where_the_view_stands_does_not_matter():
    here = marks_of(view_towards(direction(30, 20)), (direction(35, 25), 5))
    there = marks_of(view_towards(direction(30, 20), eye=(50, -20, 7)), (direction(35, 25), 5))
    assert there.place == pytest.approx(here.place, abs=1e-3)


def test_blender_projects_the_same():
    """Against a camera's own projection of a point that is far away."""
    from bpy_extras.object_utils import world_to_camera_view

    scene = fresh_scene()
    data = bpy.data.cameras.new("Camera")
    camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    data.angle = np.radians(70)
    data.clip_end = 1e7
    camera.rotation_euler = 1.2, 0.1, 0.7
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    bpy.context.view_layer.update()
    layers = bpy.context.evaluated_depsgraph_get()
    window = camera.calc_matrix_camera(layers, x=WIDTH, y=HEIGHT)
    view = View(
        np.array(window @ camera.matrix_world.inverted()), WIDTH, HEIGHT, FRAME, perspective=True
    )
    ahead = -np.array(camera.matrix_world.col[2].xyz)
    for offset in ((0, 0, 0), (0.3, 0.1, 0), (0, -0.2, 0.25)):
        to_light = (ahead + offset) / np.linalg.norm(ahead + offset)
        seen = world_to_camera_view(scene, camera, Vector(to_light * 1e6))
        marks = marks_of(view, (to_light, 1))
        assert marks.place[0] == pytest.approx([seen.x * WIDTH, seen.y * HEIGHT], abs=0.05)


def test_a_small_sun_has_a_ring_of_the_least_size():
    marks = marks_of(view_towards(direction(0, 0)), (direction(3, 2), 0.5))
    assert marks.narrow[0]
    away = np.linalg.norm(marks.lines - marks.place[0], axis=-1)
    assert away == pytest.approx(LEAST, abs=1e-9)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "edge"),
    [
        (180, 5, "top"),
        (180, -5, "bottom"),
        (100, 0, "left"),
        (-100, 0, "right"),
        (60, 0, "left"),
        (170, 0, "left"),
        (0, 60, "top"),
    ],
)
def test_a_sun_out_of_sight_is_shown_at_the_frame_on_its_side(azimuth, elevation, edge):
    view = view_towards(direction(0, 0))
    marks = marks_of(view, (direction(azimuth, elevation), 1))
    assert marks.aside[0]
    assert not FRAME.holds(marks.lines.reshape(-1, 2)).any()
    assert FRAME.holds(marks.place)[0]
    x, y = marks.place[0] - FRAME.middle
    across = {"left": -x, "right": x, "top": y, "bottom": -y}
    # Aside by the whole frame but its margin, and straight there.
    half = WIDTH / 2 if edge in ("left", "right") else HEIGHT / 2
    assert across[edge] == pytest.approx(half - 6 * LEAST, abs=1e-6)
    assert min(abs(x), abs(y)) < 1e-2


def test_exactly_behind_it_is_shown_somewhere_at_the_frame():
    marks = marks_of(view_towards(np.array([1.0, 0, 0])), (np.array([-1.0, 0, 0]), 1))
    assert marks.aside[0]
    assert np.isfinite(marks.place).all()


def test_of_a_wide_disc_around_the_viewer_what_is_ahead_is_drawn():
    marks = marks_of(view_towards(direction(0, 0)), (direction(95, 0), 120))
    assert marks.aside[0]
    assert 0 < len(marks.lines) < AROUND - 1
    assert np.isfinite(marks.lines).all()


@given(some.floats(-180, 180), some.floats(-90, 90), some.floats(-180, 180), some.floats(-89, 89))
def test_wherever_a_sun_and_the_view_are_it_is_seen_or_shown_aside(azimuth, up, turn, pitch):
    to_light, looks = direction(azimuth, up), direction(turn, pitch)
    view = view_towards(looks)
    marks = marks_of(view, (to_light, 2))
    assert FRAME.holds(marks.place)[0]
    if marks.aside[0]:
        return
    # What is seen at that pixel is the sun: the way back through the matrix.
    x, y = marks.place[0] / (WIDTH, HEIGHT) * 2 - 1
    near, far = (np.linalg.solve(view.matrix, [x, y, depth, 1]) for depth in (-1, 0.5))
    ray = far[:3] / far[3] - near[:3] / near[3]
    assert sphere.angle_between(ray / np.linalg.norm(ray), to_light) < 1e-4


# Where light comes from


def test_a_ray_ends_at_its_sun():
    view = view_towards(direction(0, 0), eye=(-5, 0, 0))
    sun = direction(10, 5)
    ray = ray_in_view(np.array([0.0, 1, 0]), sun, view, 100)
    assert ray[0] == pytest.approx([WIDTH / 2 - WIDTH / 2 / 5, HEIGHT / 2], abs=1e-3)
    assert ray[1] == pytest.approx(marks_of(view, (sun, 1)).place[0], abs=1e-6)


def test_a_ray_to_a_sun_behind_the_viewer_leaves_the_screen_on_the_way_there():
    view = view_towards(direction(0, 0), eye=(-5, 0, 0))
    pivot, sun = np.array([0.0, 1, 0]), direction(170, 10)
    begin, end = ray_in_view(pivot, sun, view, 100)
    assert not FRAME.holds(end[None])[0]
    # A point a little nearer to the sun lies on it.
    clip = view.matrix @ np.append(pivot + 0.5 * sun, 1)
    nearer = view.on_screen(clip)
    assert distances(np.array([[begin, end]]), nearer)[0] < 1e-6
    assert np.linalg.norm(nearer - begin) > 1


def test_no_ray_from_a_place_behind_the_viewer():
    view = view_towards(direction(0, 0))
    assert ray_in_view(np.array([-1.0, 0, 0]), direction(10, 0), view, 100) is None


def test_an_arrow_head_points_its_way():
    tip, one, other = arrow_head(np.array([3.0, 4.0]), np.array([0.0, -2.0]), 10)
    assert tip == pytest.approx([3, 4])
    assert (one + other) / 2 == pytest.approx([3, 14])


# In an orthographic view


@pytest.mark.parametrize(
    ("azimuth", "elevation", "across", "up", "behind"),
    [
        (0, 0, 0, 0, True),  # shines at the viewer from behind the scene
        (180, 0, 0, 0, False),
        (90, 0, -1, 0, None),
        (0, 90, 0, 1, None),
        (-45, 0, np.sqrt(0.5), 0, True),
        (180, 30, 0, 0.5, False),
    ],
)
def test_a_globe_shows_all_directions(azimuth, elevation, across, up, behind):
    view = orthographic_towards(np.array([1.0, 0, 0]))
    centre, radius = globe(view)
    marks = marks_of(view, (direction(azimuth, elevation), 10))
    assert marks.place[0] == pytest.approx(centre + radius * np.array([across, up]), abs=1e-3)
    assert not marks.aside[0]
    if behind is not None:
        assert marks.behind[0] == behind
    # No rim lies beyond the globe.
    assert np.linalg.norm(marks.lines - centre, axis=-1).max() <= radius * (1 + 1e-6) + LEAST


# Over the map


def test_on_the_map_a_sun_is_where_its_pixels_are():
    origin, size = np.array([100.0, 50.0]), np.array([400.0, 200.0])
    to_light = np.array([direction(0, 0), direction(90, 45), direction(0, 30)])
    discs = discs_in_map(to_light, np.radians([10.0, 0.1, 20]))
    marks = marks_in_map(discs, origin, size, LEAST)
    assert marks.place[0] == pytest.approx([300, 150])
    assert marks.place[1] == pytest.approx([200, 200])  # rows run downwards, pixels upwards
    assert marks.narrow.tolist() == [False, True, False]
    away = marks.lines[marks.owner == 0] - marks.place[0]
    assert np.abs(away).max(axis=(0, 1)) == pytest.approx(
        [10 / 360 * 400, 10 / 180 * 200], rel=1e-3
    )
    # Farther from the horizon the same circle is wider on the map.
    width = np.ptp(marks.lines[marks.owner == 2][..., 0])
    expected = np.degrees(np.arcsin(np.sin(np.radians(20)) / np.cos(np.radians(30)))) * 2
    assert width == pytest.approx(expected / 360 * 400, rel=1e-3)


@pytest.mark.parametrize("elevation", [0, 50, 84, 90, -89])
@pytest.mark.parametrize("azimuth", [180, 175, -178])
def test_no_outline_leaves_the_map(azimuth, elevation):
    origin, size = np.zeros(2), np.array([1000.0, 500.0])
    to_light = direction(azimuth, elevation)[None]
    marks = marks_in_map(discs_in_map(to_light, np.radians([8.0])), origin, size, LEAST)
    assert marks.lines.min() >= -1e-9
    assert (marks.lines <= size + 1e-9).all()
    # And none crosses it.
    assert np.abs(np.diff(marks.lines[..., 0])).max() < 300


# Clicks


def test_a_click_takes_the_nearest_sun_at_its_centre_or_outline():
    view = view_towards(direction(0, 0))
    marks = marks_of(view, (direction(0, 0), 20), (direction(3, 0), 0.5), (direction(180, 0), 1))
    middle = WIDTH / 2, HEIGHT / 2
    rim = WIDTH / 2 * np.tan(np.radians(10))
    assert marks.hit(*middle, 8) == 0
    assert marks.hit(middle[0] + rim + 5, middle[1], 8) == 0
    assert marks.hit(middle[0] + rim + 12, middle[1], 8) is None
    # Between centre and rim of a wide disc a click is for what is seen there.
    assert marks.hit(middle[0] + rim / 2, middle[1] + 2, 8) is None
    x, y = marks.place[1]
    assert marks.hit(x, y, 8) == 1
    assert marks.hit(*marks.place[2], 8) == 2  # its arrow


def test_without_suns_nothing_is_hit():
    none = np.empty((0, 3))
    marks = marks_in_view(none, circles(none, np.empty(0)), view_towards(direction(0, 0)), LEAST)
    assert marks.hit(10, 10, 1000) is None


@given(
    some.lists(
        some.tuples(some.floats(0, WIDTH), some.floats(0, HEIGHT), some.floats(5, 150)),
        max_size=12,
    )
)
def test_labels_never_cover_each_other_and_stay_in_the_frame(wanted):
    places = np.array([(x, y) for x, y, _ in wanted]).reshape(-1, 2)
    sizes = np.array([(width, 12.0) for _, _, width in wanted]).reshape(-1, 2)
    corners = place_labels(places, sizes, np.full(len(places), 11.0), FRAME)
    boxes = [
        (x, y, x + size[0], y + size[1])
        for (x, y), size in ((c, s) for c, s in zip(corners, sizes, strict=True) if c)
    ]
    for number, (left, bottom, right, top) in enumerate(boxes):
        assert left >= 0
        assert bottom >= 0
        assert right <= WIDTH
        assert top <= HEIGHT
        for other in boxes[:number]:
            assert left >= other[2] or other[0] >= right or bottom >= other[3] or other[1] >= top


def test_the_first_label_stands_right_and_above():
    places, sizes = np.array([[100.0, 100], [102, 100]]), np.array([[40.0, 12], [40, 12]])
    first, second = place_labels(places, sizes, np.array([10.0, 10]), FRAME)
    assert first == (110, 110)
    assert second == (102 - 10 - 40, 110)
