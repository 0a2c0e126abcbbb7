"""Processes that die, hoard memory, print or lose their master."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from sunsplit.core.library.local import Done, LocalWorkers, Task, own_memory
from sunsplit.core.library.memory import (
    LEAST,
    MEGABYTE,
    memory_of,
    parse_memory,
    usable_memory,
)
from sunsplit.core.library.processes import converter
from sunsplit.core.library.scan import MapFile
from sunsplit.core.library.serving import ORPHANED
from sunsplit.core.settings import BadSetting

ODD = [sys.executable, str(Path(__file__).parent.parent / "odd_worker.py")]

PLENTY = 1 << 40


def run(jobs, count=2, memory=PLENTY, estimate=0) -> list[Done]:
    tasks = [Task(job, estimate) for job in jobs]
    with LocalWorkers(ODD, count, memory) as pool:
        return [done for done in pool.run(tasks) if done]


def family():
    return psutil.Process().children(recursive=True)


def test_jobs_are_shared_by_as_many_processes_as_were_asked_for():
    done = run([{"number": n, "sleep": 0.1} for n in range(8)], count=2)
    assert sorted(each.answer["number"] for each in done) == list(range(8))
    assert len({each.answer["pid"] for each in done}) == 2
    assert family() == []


def test_no_more_processes_are_started_than_there_are_jobs():
    assert len(run([{}], count=5)) == 1


def test_what_libraries_print_is_no_answer(capfd):
    assert [each.answer["print"] for each in run([{"print": 1}])] == [1]
    said, complaints = capfd.readouterr()
    assert said == ""
    assert "a library prints" in complaints
    assert "and another one" in complaints


def test_what_a_worker_chatters_is_only_told_when_it_fails(capfd):
    with LocalWorkers(ODD, 1, PLENTY, chatter=True) as pool:
        assert len([each for each in pool.run([Task({"print": 1}, 0)]) if each]) == 1
        assert capfd.readouterr() == ("", "")
        done = [each for each in pool.run([Task({"print": 1, "raise": "a bug"}, 0)]) if each]
    assert [each.sentence for each in done] == ["The worker died over it (exit status 1)."]
    said, complaints = capfd.readouterr()
    assert said == ""
    assert "a library prints" in complaints
    assert "RuntimeError: a bug" in complaints


def test_a_worker_that_dies_takes_nothing_else_along():
    done = run([{"number": 0}, {"kill": 1}, {"number": 1}, {"number": 2}])
    failed = [each for each in done if each.answer is None]
    assert [each.sentence for each in failed] == ["The worker died over it (signal 9)."]
    assert sorted(each.answer["number"] for each in done if each.answer) == [0, 1, 2]


def test_a_worker_that_dies_once_is_given_another_try(tmp_path):
    assert run([{"first": str(tmp_path / "tried")}])[0].answer is not None


def test_leaving_the_workers_ends_them_at_once():
    began = time.monotonic()
    with LocalWorkers(ODD, 2, PLENTY) as pool:
        for _ in pool.run([Task({"sleep": 60}, 0), Task({"sleep": 60}, 0)]):
            if len(family()) == 2:
                break
    assert family() == []
    assert time.monotonic() - began < 30


# Memory


def test_jobs_that_do_not_fit_together_are_done_one_after_the_other():
    estimate = 600 * MEGABYTE
    jobs = [{"number": n, "sleep": 0.2} for n in range(3)]
    memory = own_memory() + int(1.5 * estimate)
    done = run(jobs, count=3, memory=memory, estimate=estimate)
    assert len(done) == 3
    assert len({each.answer["pid"] for each in done}) == 1


def test_small_jobs_are_done_beside_a_large_one():
    large, small = Task({"sleep": 3.0, "number": 0}, 1000 * MEGABYTE), 100 * MEGABYTE
    tasks = [large, Task({"number": 1}, 1000 * MEGABYTE), Task({"number": 2}, small)]
    with LocalWorkers(ODD, 2, own_memory() + 1500 * MEGABYTE) as pool:
        done = [each.answer["number"] for each in pool.run(tasks) if each]
    assert done == [2, 0, 1]


@pytest.mark.parametrize("count", [1, 2])
def test_what_takes_more_than_was_foreseen_is_stopped_before_the_limit(count):
    limit = own_memory() + 400 * MEGABYTE
    highest = 0
    tasks = [Task({"hold": 2000, "number": 0}, 50 * MEGABYTE)]
    tasks += [Task({"hold": 20, "number": n}, 50 * MEGABYTE) for n in range(1, 5)]
    done = []
    with LocalWorkers(ODD, count, limit) as pool:
        for each in pool.run(tasks):
            held = own_memory() + sum(_memory(process) for process in family())
            highest = max(highest, held)
            done += [each] if each else []
    assert sorted(each.answer["number"] for each in done if each.answer) == [1, 2, 3, 4]
    assert [each.sentence for each in done if each.answer is None] == [
        "It needs more memory than there is: allow more by --memory."
    ]
    assert highest <= limit


def _memory(process):
    try:
        return process.memory_info().rss
    except psutil.Error:
        return 0


@pytest.mark.parametrize(
    ("text", "number"),
    [("800M", 800 << 20), ("16G", 16 << 30), ("1.5 GiB", 3 << 29), ("2t", 2 << 40), ("1024", 1024)],
)
def test_sizes_of_memory_are_read(text, number):
    assert parse_memory(text) == number


@pytest.mark.parametrize("text", ["", "much", "-1G", "1X", "1 G G"])
def test_what_is_no_size_of_memory_is_refused(text):
    with pytest.raises(BadSetting, match="800M"):
        parse_memory(text)


def test_memory_that_is_used_by_itself_is_a_part_of_what_is_free():
    free = psutil.virtual_memory().available
    assert LEAST < usable_memory() < free


def test_wide_maps_take_more_memory_and_held_ones_most():
    narrow, wide, written, held = (
        memory_of(MapFile("a", width, width // 2, held, 1), written)
        for width, held, written in (
            *((1024, False, 0), (16384, False, 0)),
            *((16384, False, 16384), (16384, True, 0)),
        )
    )
    assert narrow < wide < written < held


# A master that dies


def test_a_worker_ends_with_its_master_and_in_the_midst_of_a_job():
    worker = subprocess.Popen(ODD, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8")
    worker.stdin.write('{}\n{"number": 1}\n')
    worker.stdin.flush()
    assert json.loads(worker.stdout.readline())["number"] == 1
    worker.stdin.write('{"sleep": 60}\n')
    worker.stdin.flush()
    time.sleep(0.3)
    assert worker.poll() is None
    worker.stdin.close()
    assert worker.wait(10) == ORPHANED
    worker.stdout.close()


def test_an_idle_worker_ends_well_with_its_master():
    done = subprocess.run(ODD, input="{}\n", capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "")


def test_workers_do_not_hear_ctrl_c():
    worker = subprocess.Popen(ODD, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8")
    worker.stdin.write("{}\n{}\n")
    worker.stdin.flush()
    worker.stdout.readline()
    worker.send_signal(signal.SIGINT)
    worker.stdin.write('{"number": 1}\n')
    worker.stdin.flush()
    assert json.loads(worker.stdout.readline())["number"] == 1
    worker.stdin.close()
    assert worker.wait(10) == 0
    worker.stdout.close()


def test_converter_is_isolated_from_what_lies_around(tmp_path):
    """A user's own module of the name of one of Python's is not taken for it."""
    (tmp_path / "json.py").write_text("raise SystemExit('not this one')")
    done = subprocess.run(
        converter(),
        input=json.dumps({"path": sys.path}) + "\n",
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
