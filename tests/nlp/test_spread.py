"""Workers are killed and hang for real; every start comes back once, or is named as lost."""

import itertools
import os
import signal
import time
from functools import partial

import casadi as ca
import numpy as np
import psutil
import pytest

from nlp.errors import WorkerError
from nlp.multistart import multistart
from nlp.problem import Problem
from nlp.processes import Processes
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
        if arrival.results is None:
            lost += arrival.chunk.indices
        else:
            done += [one.result for one in arrival.results]
    return sorted(done), sorted(lost)


@pytest.fixture(autouse=True)
def _no_processes_left_running():
    yield
    Processes(2).kill([])


@pytest.mark.parametrize("kind", ["die", pytest.param("hang", marks=pytest.mark.slow)])
def test_a_worker_that_fails_once_costs_nothing(tmp_path, kind):
    payload = task_of(partial(mischief, folder=tmp_path, kind=kind, bad=13, once=True))
    limit = 10.0 if kind == "hang" else None
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


@pytest.mark.slow
def test_chunks_beside_one_that_hangs_are_run_again(tmp_path):
    payload = task_of(partial(slowly, folder=tmp_path))
    done, lost = collect(spread(chunks(payload, 60), Processes(2), 5.0))
    assert (done, lost) == (list(range(60)), [])


def test_a_start_that_always_kills_is_lost_alone(tmp_path):
    payload = task_of(partial(mischief, folder=tmp_path, kind="die", bad=13, once=False))
    done, lost = collect(spread(chunks(payload, 40), Processes(2)))
    assert lost == [13]
    assert done == [k for k in range(40) if k != 13]


def test_multistart_names_the_start_that_kills(tmp_path):
    judge = partial(mischief, folder=tmp_path, kind="die", bad=3, once=False)
    with pytest.raises(WorkerError, match="Start 3 ends its worker process"):
        multistart(parabola, sample, starts=12, workers=2, judge=judge)


def test_all_workers_killed_from_outside():
    payload, seen = task_of(index_of), []
    arrivals = spread(chunks(payload, 200), Processes(2))
    for arrival in arrivals:
        seen += [one.result for one in arrival.results]
        if len(seen) in (20, 100):
            for child in psutil.Process().children():
                if "popen_loky" in " ".join(child.cmdline()):
                    child.kill()
    assert sorted(seen) == list(range(200))


def test_errors_of_the_task_are_passed_on():
    payload = packed(Task(parabola, sample, {}, partial(np.linalg.inv)))
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
