"""A real Dask cluster on this machine: the same records, whatever happens to its workers."""

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path

import casadi as ca
import pytest

from nlp import executors
from nlp.dispatch import dispatch
from nlp.errors import InputError, WorkerError
from nlp.executors import DaskExecutor
from nlp.multistart import multistart
from nlp.problem import Problem
from nlp.starts import Chunk, RunChunk, Task, packed

distributed = pytest.importorskip(
    "distributed", reason='Dask is missing: pip install ".[cluster]"'
)

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


def hang(run, folder, once):
    if run.index == 5 and not (once and (folder / "hung").exists()):
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


def test_a_worker_killed_mid_run_costs_nothing(cluster):
    todo, seen, killed = chunks(slow_point, 200), [], []
    with DaskExecutor(cluster.scheduler_address) as executor:
        for result in dispatch(todo, executor):
            seen += [start.result for start in result.finished]
            if len(seen) >= 30 and not killed:
                killed.append(next(iter(cluster.workers.values())).process.process)
                killed[0].kill()
    here = [start.result for chunk in todo for start in pickle.loads(RunChunk()(chunk))]
    assert sorted(seen) == here, "every start once, bit for bit as in this process"


@pytest.mark.parametrize("once", [True, False])
def test_a_start_that_hangs_ends_its_worker_alone(cluster, tmp_path, once):
    todo = chunks(partial(hang, folder=tmp_path, once=once), 60)
    with DaskExecutor(cluster.scheduler_address) as executor:
        results = list(dispatch(todo, executor, 1.0))
    finished = sorted(start.result for result in results for start in result.finished)
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


@contextmanager
def serving(reply=b""):
    """Yield the address of a server that answers every connection with the same bytes."""

    def answer():
        with suppress(OSError):
            while True:
                connections.append(server.accept()[0])
                connections[-1].sendall(reply)

    connections = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=answer, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
    for connection in connections:
        connection.close()


@pytest.mark.parametrize(
    "reply",
    [None, b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"],
    ids=["closed port", "silent", "HTTP"],
)
def test_a_server_that_is_no_scheduler_is_given_up(monkeypatch, reply):
    monkeypatch.setattr(executors, "_PATIENCE", 1.0)
    server = nullcontext("tcp://127.0.0.1:1") if reply is None else serving(reply)
    with server as address, pytest.raises(WorkerError, match="No Dask scheduler answers"):
        DaskExecutor(address)


@pytest.mark.parametrize("address", ["nonsense://x", "tls://127.0.0.1:8786"])
def test_refuses_addresses_that_nothing_can_have(address):
    with pytest.raises((InputError, WorkerError), match=address):
        DaskExecutor(address)


@pytest.mark.parametrize("what", ["scheduler killed", "scheduler stopped", "workers killed"])
def test_a_cluster_that_ends_half_way_is_given_up(tmp_path, monkeypatch, what):
    """What arrived before is kept; then one error."""
    with dask_processes(tmp_path) as (address, scheduler, worker):
        seen = []
        victim = worker if what == "workers killed" else scheduler
        sent = signal.SIGSTOP if what == "scheduler stopped" else signal.SIGKILL

        def run():
            with DaskExecutor(address) as executor:
                monkeypatch.setattr(executors, "_PATIENCE", 3.0)  # now that it is there
                for result in dispatch(chunks(slow_point, 2000), executor):
                    assert not result.failed
                    seen.extend(start.result for start in result.finished)
                    if len(seen) == 30:
                        os.kill(victim.pid, sent)

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
        while not (file := folder / "scheduler.json").exists() or not file.read_text():
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        command = [sys.executable, "-m", "dask", "worker", address, "--no-nanny"]
        command += ["--nthreads", "1", "--no-dashboard"]
        processes.append(subprocess.Popen(command, **quiet, **path))
        yield address, *processes
    finally:
        for process in processes:
            process.kill()
            process.wait()
