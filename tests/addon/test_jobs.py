"""Conversions beside a living window: the same result, cancelled at any moment."""

from __future__ import annotations

import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import bpy
import numpy as np
import pytest

from sunsplit.addon import known
from sunsplit.addon.jobs import AT_A_TIME, NICENESS, Job
from sunsplit.addon.options import SceneOptions
from sunsplit.addon.restoring import restore_scene
from sunsplit.addon.scene import conversion_steps, convert_scene
from sunsplit.addon.steps import Apart, run_at_once
from sunsplit.core import ConversionSettings
from sunsplit.core.errors import SunsplitError, UnusableInput
from tests.addon.test_convert import inventory, world_state
from tests.blender import (
    add_mesh,
    camera_towards,
    diffuse,
    fresh_scene,
    hdri_world,
    plate_mesh,
    suns,
    to_light,
)


@pytest.fixture
def scene(sunrise):
    """On a wide ground, so that rays are cast, and with nothing known of the map."""
    from mathutils import Matrix

    known.forget()
    made = fresh_scene()
    hdri_world(made, sunrise)
    add_mesh(made, plate_mesh(1000), diffuse("Ground", 0.5), Matrix())
    camera_towards(made, np.array([1, 0, -1]), 40, 64).location = (0, 0, 3)
    bpy.context.view_layer.update()
    yield made
    if Job.running:
        Job.running.cancel()


def steps(scene):
    return conversion_steps(scene, ConversionSettings(), SceneOptions())


def ended(job: Job, ticks: int | None = None) -> int:
    """Go on until the job ends, or for so many ticks; how many it took."""
    count = 0
    while (ticks is None or count < ticks) and not job.advance():
        count += 1
        time.sleep(0.002)
    return count


class HeldJob(Job):
    """Its thread stays at a stage until the job is cancelled."""

    def __init__(self, steps, stage):
        self._held_at = stage
        super().__init__(steps)

    def _listen(self, stage, fraction):
        super()._listen(stage, fraction)
        if stage == self._held_at:
            assert self._cancelled.wait(60)
            super()._listen(stage, fraction)


def state(scene):
    return inventory(), world_state(scene.world), scene.sunsplit.report


def lamps(scene):
    return [(lamp.name, lamp.data.energy, tuple(to_light(lamp))) for lamp in suns(scene)]


def test_a_job_makes_what_a_script_gets(scene):
    convert_scene(scene, ConversionSettings())
    expected = state(scene), lamps(scene)
    restore_scene(scene)
    known.forget()
    job = Job(steps(scene))
    assert ended(job) > 1
    assert job.error is None
    assert job.result.world == scene.world
    assert (state(scene), lamps(scene)) == expected
    assert job.fraction > 0.85
    assert Job.running is None


def test_no_step_in_the_main_thread_takes_long(scene):
    """But the last one, which changes the scene, and steps of Blender's own."""
    job = Job(steps(scene))
    spent = []
    while True:
        started = time.thread_time()
        done = job.advance()
        if done:
            break
        spent.append(time.thread_time() - started)
        time.sleep(0.002)
    # Seconds of this thread's own work: how busy the machine is does not count.
    assert np.median(spent) < AT_A_TIME


@pytest.mark.parametrize("earlier", [False, True], ids=["first", "again"])
def test_cancelled_at_any_moment_the_scene_is_as_it_was(scene, earlier):
    if earlier:
        convert_scene(scene, ConversionSettings(lights=2))
    before = state(scene), lamps(scene) if earlier else None
    for stage in ("reading", "strata", "region A", "suns", "residual", "account"):
        known.forget()
        job = HeldJob(steps(scene), stage)
        while job.stage != stage:
            assert not job.advance()
        job.cancel()
        assert job.is_cancelled
        assert job.advance()
        assert job.result is None
        assert job.error is None
        assert (state(scene), lamps(scene) if earlier else None) == before
    assert ended(Job(steps(scene))) >= 0
    assert scene.sunsplit.is_converted


def test_a_job_waits_for_the_thread_that_the_last_one_left(scene):
    gate, order = threading.Event(), []

    def slow():
        yield Apart(lambda *_: (gate.wait(10), order.append("slow")), 0, 1)

    def quick():
        order.append("quick")
        yield

    first = Job(slow())
    first.advance()
    first.cancel()
    second = Job(quick())
    assert not second.advance()
    assert order == []
    gate.set()
    ended(second)
    assert order == ["slow", "quick"]


def test_an_error_in_the_thread_reaches_the_steps_and_then_the_user(scene):
    cleaned = []

    def failing():
        def fail(*_):
            raise UnusableInput("No.")

        try:
            yield Apart(fail, 0, 1)
        finally:
            cleaned.append(True)

    job = Job(failing())
    ended(job)
    assert isinstance(job.error, SunsplitError)
    assert cleaned == [True]


def test_a_thread_may_ask_for_steps_in_the_main_thread(scene):
    main, seen = threading.get_ident(), []

    def asked():
        for _ in range(3):
            seen.append(threading.get_ident())
            yield
        return "answer"

    def asking():
        return (yield Apart(lambda _, in_main: in_main(asked()), 0, 1))

    job = Job(asking())
    ended(job)
    assert job.result == "answer"
    assert seen == [main] * 3
    assert run_at_once(asking()) == "answer"


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is done")
def test_the_thread_gives_way_to_the_window():
    def niceness(*_):
        with ThreadPoolExecutor(1) as pool:
            helper = pool.submit(threading.get_native_id).result()
            ids = threading.get_native_id(), helper
            return [os.getpriority(os.PRIO_PROCESS, thread) for thread in ids]

    def asking():
        return (yield Apart(niceness, 0, 1))

    before = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    job = Job(asking())
    ended(job)
    assert job.result == [max(before, NICENESS)] * 2
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) == before


@pytest.mark.parametrize("why", ["undo", "load"])
def test_data_that_goes_ends_the_job(scene, why, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.ed.undo_push(message="after")
    job = Job(steps(scene))
    ended(job, 2)
    if why == "undo":
        bpy.ops.ed.undo()
    else:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert job.is_cancelled
    assert Job.running is None
    assert job.advance()
    assert not bpy.context.scene.sunsplit.is_converted
