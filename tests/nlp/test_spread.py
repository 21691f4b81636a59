"""Workers are killed and hang for real; every start comes back once, or is named as lost."""

import itertools
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np
import psutil
import pytest

from nlp.errors import WorkerError
from nlp.multistart import multistart
from nlp.problem import Problem
from nlp.processes import Processes, end_idle_processes
from nlp.spread import spread
from nlp.task import Chunk, Task, packed

pytestmark = pytest.mark.processes


def parabola():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))


def sample(rng):
    return rng.normal(size=2)


def index_of(run):
    return run.index


def mischief(run, folder, kind, bad, once):
    """Judge that kills or hangs its worker at the start `bad`: the first time, or always."""
    mark = folder / f"{kind}{run.index}"
    if run.index == bad and not (once and mark.exists()):
        mark.touch()
        if kind == "hang":
            time.sleep(600)
        os.kill(os.getpid(), signal.SIGKILL)
    return run.index


def task_of(judge):
    return packed(Task(parabola, sample, {}, judge))


def chunks(payload, starts, size=10):
    return [Chunk(payload, 0, range(k, min(k + size, starts))) for k in range(0, starts, size)]


def collect(arrivals):
    done, lost = [], []
    for arrival in arrivals:
        lost += [one.index for one in arrival.lost]
        done += [one.result for one in arrival.results]
    return sorted(done), sorted(lost)


@pytest.fixture(autouse=True)
def _no_processes_left_running():
    yield
    end_idle_processes()


@pytest.mark.parametrize("kind", ["die", pytest.param("hang", marks=pytest.mark.long)])
def test_a_worker_that_fails_once_costs_nothing(tmp_path, kind):
    payload = task_of(partial(mischief, folder=tmp_path, kind=kind, bad=13, once=True))
    limit = 1.0 if kind == "hang" else None
    done, lost = collect(spread(chunks(payload, 40), Processes(2), limit))
    assert (tmp_path / f"{kind}13").exists(), "it did fail"
    assert done == list(range(40))
    assert lost == []


def slowly(run, folder):
    if run.index == 0 and not (folder / "hung").exists():
        (folder / "hung").touch()
        time.sleep(600)
    time.sleep(0.15)
    return run.index


@pytest.mark.long
def test_chunks_beside_one_that_hangs_are_run_again(tmp_path):
    payload = task_of(partial(slowly, folder=tmp_path))
    done, lost = collect(spread(chunks(payload, 60), Processes(2), 0.5))
    assert (done, lost) == (list(range(60)), [])


def test_a_start_that_always_kills_is_lost_alone(tmp_path):
    payload = task_of(partial(mischief, folder=tmp_path, kind="die", bad=13, once=False))
    done, lost = collect(spread(chunks(payload, 40), Processes(2)))
    assert lost == [13]
    assert done == [k for k in range(40) if k != 13]


def test_multistart_names_the_start_that_kills(tmp_path):
    judge = partial(mischief, folder=tmp_path, kind="die", bad=3, once=False)
    with pytest.raises(WorkerError, match="Start 3 ended its process"):
        multistart(parabola, sample, starts=12, workers=2, judge=judge)


def leaves(run):
    if run.index == 3:
        os._exit(0)
    return run.index


def test_a_worker_that_ends_with_status_0_is_noticed():
    arrivals = list(spread(chunks(task_of(leaves), 20), Processes(2)))
    assert collect(arrivals)[1] == [3]
    assert [one.why for arrival in arrivals for one in arrival.lost] == ["ended its process"]


def test_a_start_that_always_hangs_is_lost_alone(tmp_path):
    payload = task_of(partial(mischief, folder=tmp_path, kind="hang", bad=3, once=False))
    arrivals = list(spread(chunks(payload, 20, size=4), Processes(2), 0.5))
    assert collect(arrivals) == ([k for k in range(20) if k != 3], [3])
    assert [one.why for one in arrivals[-1].lost] == ["exceeded the time limit"]


def slow_parabola():
    time.sleep(3)
    return parabola()


def test_building_does_not_count_as_running():
    payload = packed(Task(slow_parabola, sample, {}, index_of))
    assert collect(spread(chunks(payload, 20), Processes(2), 0.1)) == (list(range(20)), [])


def test_no_more_processes_than_work():
    study = multistart(parabola, sample, starts=2, workers=10**6, judge=index_of)
    assert study.results == (0, 1)
    assert len(workers_of()) == 2


def workers_of(process=None):
    children = (process or psutil.Process()).children()
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


ORPHANS = """
import sys, time
sys.path.insert(0, {root!r})
import casadi as ca
from nlp.multistart import multistart
from nlp.problem import Problem

def build():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))

print("started", flush=True)
multistart(build, lambda rng: time.sleep(600), starts=2, workers=2)
"""


def test_workers_that_hang_end_with_a_killed_parent():
    script = ORPHANS.format(root=str(Path(__file__).parents[2]))
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    process.stdout.readline()
    parent, workers = psutil.Process(process.pid), []
    while len(workers) < 2:
        workers = workers_of(parent)
        time.sleep(0.1)
    time.sleep(4)  # they import, build and hang
    process.kill()
    process.communicate()
    assert not psutil.wait_procs(workers, timeout=120)[1]


def test_all_workers_killed_from_outside():
    payload, seen = task_of(index_of), []
    arrivals = spread(chunks(payload, 200), Processes(2))
    for arrival in arrivals:
        seen += [one.result for one in arrival.results]
        if len(seen) in (20, 100):
            for child in workers_of():
                child.kill()
    assert sorted(seen) == list(range(200))


def fails(run, bad):
    if run.index in bad:
        np.linalg.inv(np.zeros((2, 2)))
    return run.index


def test_an_exception_loses_its_start_only():
    payload = task_of(partial(fails, bad=(3, 14)))
    arrivals = list(spread(chunks(payload, 40), Processes(2)))
    done, lost = collect(arrivals)
    assert lost == [3, 14]
    assert done == [k for k in range(40) if k not in lost]
    one = next(one for arrival in arrivals for one in arrival.lost)
    assert one.why == "raised LinAlgError: Singular matrix"
    assert isinstance(one.error, np.linalg.LinAlgError)


@pytest.mark.parametrize("workers", [1, 2])
def test_multistart_passes_exceptions_on(workers):
    with pytest.raises(np.linalg.LinAlgError):
        multistart(parabola, sample, starts=12, workers=workers, judge=partial(fails, bad=(3,)))


def test_errors_of_building_are_passed_on():
    payload = packed(Task(partial(np.linalg.inv, np.zeros((2, 2))), sample, {}, index_of))
    with pytest.raises(np.linalg.LinAlgError):
        list(spread(chunks(payload, 20), Processes(2)))


def test_draws_chunks_only_as_workers_ask():
    payload, drawn = task_of(index_of), itertools.count()
    endless = (Chunk(payload, 0, range(10 * k, 10 * k + 10)) for k in drawn)
    arrivals = spread(endless, Processes(2))
    for _ in range(30):
        next(arrivals)
    arrivals.close()
    assert next(drawn) <= 30 + 4
