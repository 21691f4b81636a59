"""A real Dask cluster on this machine: the same records, whatever happens to its workers."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from unittest.mock import Mock

import casadi as ca
import pytest

from lockedjoint.commands import campaign
from lockedjoint.commands.campaign import dask_executor
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.improve import improve
from lockedjoint.nlp.errors import WorkerError
from lockedjoint.nlp.executors import dispatch
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.starts import Chunk, RunChunk, Task, packed

distributed = pytest.importorskip(
    "distributed", reason='Dask is missing: pip install ".[cluster]"'
)
dask = pytest.importorskip("dask")

# Dask's own: ports taken, connections closed while workers are killed.
pytestmark = [
    pytest.mark.processes,
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


_CLUSTER = {"distributed.scheduler.allowed-failures": 0}
_CLUSTER["distributed.deploy.lost-worker-timeout"] = "1h"
# Workers are forked from a process that has imported what they need: a new one begins at once.
_CLUSTER["distributed.worker.multiprocessing-method"] = "forkserver"
_IMPORTED = [
    "distributed",
    "lockedjoint.nlp.multistart",
    "lockedjoint.formulations.atlas.improve",
]


def parabola():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))


def sample(rng):
    return rng.normal(size=2)


def slow_point(run):
    time.sleep(0.02)
    return run.index, run.solution.variables.tobytes()


def hang(run, folder, once):
    if run.index == 5 and not (once and (folder / "hung").exists()):
        (folder / "hung").touch()
        time.sleep(600)
    return run.index


@pytest.fixture(scope="module")
def cluster():
    """Two workers that stay although tasks end them; on a busy machine none was left before.

    A task that ends its worker is not given to the next one by Dask itself: it would end that
    one while its nanny still starts it, and no nanny starts it again then. And this cluster, of
    all of Dask's, dismisses the nanny of a worker that is not back 15 s after it ended.
    """
    with dask.config.set(_CLUSTER):
        distributed.utils.get_mp_context().set_forkserver_preload(_IMPORTED)
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as started:
            yield started


def chunks(judge, starts):
    payload = packed(Task(parabola, sample, {}, judge))
    return [Chunk(payload, 3, range(k, k + 10)) for k in range(0, starts, 10)]


def test_a_worker_killed_mid_run_costs_nothing(cluster):
    todo, seen, killed = chunks(slow_point, 200), [], []
    with dask_executor(cluster.scheduler_address) as executor:
        for result in dispatch(todo, executor):
            seen += result.finished.values()
            if len(seen) >= 30 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)
    here = [v for chunk in todo for v in pickle.loads(RunChunk()(chunk)).finished.values()]
    assert sorted(seen) == here, "every start once, bit for bit as in this process"


@pytest.mark.parametrize("once", [True, False])
def test_a_start_that_hangs_ends_its_worker_alone(cluster, tmp_path, once):
    todo = chunks(partial(hang, folder=tmp_path, once=once), 60)
    with dask_executor(cluster.scheduler_address) as executor:
        results = list(dispatch(todo, executor, 2.0))
    finished = sorted(value for result in results for value in result.finished.values())
    failed = [start.index for result in results for start in result.failed]
    assert (tmp_path / "hung").exists()
    assert failed == ([] if once else [5])
    assert finished == [k for k in range(60) if k not in failed]


def test_a_clients_own_executor_will_do(cluster):
    with distributed.Client(cluster) as client:
        executor = client.get_executor(pure=False)
        study = multistart(parabola, sample, starts=30, seed=3, executor=executor)
    here = multistart(parabola, sample, starts=30, seed=3)
    points = [[run.solution.variables.tobytes() for run in s.results] for s in (study, here)]
    assert points[0] == points[1]


def test_a_campaign_runs_on_it(cluster, lockedjoint, tmp_path):
    grid = 'starts = 30\nformulations = ["residual"]\nmodels = ["free"]\njoints = [3]\n'
    (tmp_path / "c.toml").write_text(f"{grid}task_dimensions = [2]\n")
    words = ("campaign", "c.toml", "s.db", "--scheduler", cluster.scheduler_address)
    done = lockedjoint.here(*words, cwd=tmp_path)
    assert "30 of 30 records of 1 cases" in done.stdout, done.stderr


@pytest.mark.parametrize(
    "address",
    ["tcp://127.0.0.1:1", "nonsense://x", "tls://127.0.0.1:8786", "tcp://127.0.0.1:x"],
)
def test_refuses_addresses_where_no_scheduler_answers(monkeypatch, address):
    monkeypatch.setattr(campaign, "_CONNECT_SECONDS", 1.0)
    with pytest.raises(WorkerError, match=address), dask_executor(address):
        pass


def test_a_scheduler_that_ends_half_way_is_given_up(tmp_path):
    """What arrived before is kept; then one error."""
    with dask_processes(tmp_path) as (address, scheduler, _):
        seen = []

        def run():
            with dask_executor(address) as executor:
                for result in dispatch(chunks(slow_point, 2000), executor):
                    assert not result.failed
                    seen.extend(result.finished.values())
                    if len(seen) == 30:
                        scheduler.kill()

        with pytest.raises(WorkerError, match="results so far are kept"):
            run()
    assert len(seen) == len(set(seen)) >= 30


@contextmanager
def dask_processes(folder):
    """Yield the address and the processes of a scheduler and of a worker without a nanny."""
    command = [sys.executable, "-m", "dask", "scheduler", "--port", "0", "--no-dashboard"]
    command += ["--host", "127.0.0.1", "--scheduler-file", "scheduler.json"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    path = {"env": {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}}
    processes = [subprocess.Popen(command, **quiet, **path)]
    try:
        deadline = time.monotonic() + 120
        while not (file := folder / "scheduler.json").exists() or not file.read_text():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        command = [sys.executable, "-m", "dask", "worker", address, "--no-nanny"]
        command += ["--nthreads", "1", "--no-dashboard"]
        processes.append(subprocess.Popen(command, **quiet, **path))
        yield address, *processes
    finally:
        for process in processes:
            process.kill()
            process.wait(timeout=120)


def test_an_entry_of_the_atlas_is_searched_alike(cluster, monkeypatch):
    """Pages that come from the cluster, seed after seed, are those of this process."""
    monkeypatch.setattr("lockedjoint.formulations.atlas.improve._SEEDS_AHEAD", 3)
    asked = entry("free-mean_2x7_k3")

    def pages(executor):
        return list(islice(improve(asked, None, 5.0, executor=executor), 3))

    with dask_executor(cluster.scheduler_address) as executor:
        away = pages(executor)
    assert len({page.found.seeds for page in away}) > 2
    for one, same in zip(away, pages(None), strict=True):
        for name in ("seeds", "starts", "reached_best"):
            assert getattr(one.found, name) == getattr(same.found, name)
        assert one.value == same.value


def test_a_search_whose_executor_ends_says_so():
    cancelled = Future()
    cancelled.cancel()
    executor = Mock(ThreadPoolExecutor, submit=Mock(return_value=cancelled))
    with pytest.raises(WorkerError, match="Seed 0 did not come back"):
        list(improve(entry("free-mean_2x7_k3"), None, 5.0, executor=executor))
