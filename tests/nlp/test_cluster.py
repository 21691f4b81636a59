"""A real Dask cluster on this machine: the same records, whatever happens to its workers."""

import time
from functools import partial

import casadi as ca
import pytest

from nlp.errors import InputError
from nlp.problem import Problem
from nlp.spread import spread
from nlp.task import Chunk, Task, packed, run_chunk

distributed = pytest.importorskip("distributed")

# Dask's own: ports taken, connections closed while workers are killed.
pytestmark = [
    pytest.mark.processes,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


def parabola():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))


def sample(rng):
    return rng.normal(size=2)


def slow_point(run):
    time.sleep(0.02)
    return run.index, run.solution.variables.tobytes()


def hang_once(run, folder):
    if run.index == 5 and not (folder / "hung").exists():
        (folder / "hung").touch()
        time.sleep(600)
    return run.index


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as started:
        yield started


def chunks(judge, starts):
    payload = packed(Task(parabola, sample, {}, judge))
    return [Chunk(payload, 3, range(k, k + 10)) for k in range(0, starts, 10)]


def collected(cluster, todo, limit=None, during=len):
    from nlp.cluster import DaskCluster

    pool, seen = DaskCluster(cluster.scheduler_address), []
    for arrival in spread(todo, pool, limit):
        seen += [one.result for one in arrival.results]
        during(seen)
    pool.close()
    return sorted(seen)


@pytest.mark.slow
def test_a_worker_killed_mid_run_costs_nothing(cluster):
    killed = []

    def kill(seen):
        if len(seen) >= 30 and not killed:
            nanny = next(iter(cluster.workers.values()))
            killed.append(nanny.pid)
            nanny.process.process.kill()

    todo = chunks(slow_point, 200)
    there = collected(cluster, todo, during=kill)
    here = [one.result for c in todo for one in run_chunk(c.payload, c.seed, c.indices)]
    assert killed
    assert there == here, "every start once, bit for bit as in this process"


@pytest.mark.slow
def test_a_worker_that_hangs_is_restarted(cluster, tmp_path):
    seen = collected(cluster, chunks(partial(hang_once, folder=tmp_path), 60), limit=6.0)
    assert (tmp_path / "hung").exists()
    assert seen == list(range(60))


def test_says_so_when_no_scheduler_answers(monkeypatch):
    from nlp import cluster as module

    monkeypatch.setattr(module, "_PATIENCE", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://x"):
        with pytest.raises(InputError, match="Dask scheduler that answers"):
            module.DaskCluster(address)


@pytest.mark.slow
def test_waiting_for_a_worker_does_not_count(cluster, tmp_path):
    """Chunks of three seconds behind others of three seconds, within a limit of five."""
    mark = partial(three_seconds_a_chunk, folder=tmp_path)
    todo = chunks(mark, 40)
    assert collected(cluster, todo, limit=5.0) == list(range(40))
    runs = [path.read_text().count("x") for path in sorted(tmp_path.iterdir())]
    assert runs == [1] * 40, "none was killed and run again"


def three_seconds_a_chunk(run, folder):
    with (folder / f"{run.index:03}").open("a") as file:
        file.write("x")
    time.sleep(0.3)
    return run.index
