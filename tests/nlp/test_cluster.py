"""A real Dask cluster on this machine: the same records, whatever happens to its workers."""

import json
import os
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

from nlp import cluster as module
from nlp.errors import InputError, WorkerError
from nlp.problem import Problem
from nlp.spread import spread
from nlp.task import Chunk, Task, packed, run_chunk

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
    pool, seen = module.DaskCluster(cluster.scheduler_address), []
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


@pytest.mark.long
def test_a_worker_that_hangs_is_restarted(cluster, tmp_path):
    seen = collected(cluster, chunks(partial(hang_once, folder=tmp_path), 60), limit=0.6)
    assert (tmp_path / "hung").exists()
    assert seen == list(range(60))


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
    ("reply", "said"),
    [(None, "answers"), (b"", "answers"), (b"HTTP/1.1 400 Bad Request\r\n\r\n", "is not")],
    ids=["closed port", "silent", "HTTP"],
)
def test_a_server_that_is_no_scheduler_is_given_up(monkeypatch, reply, said):
    monkeypatch.setattr(module, "_PATIENCE", 0.5)
    server = nullcontext("tcp://127.0.0.1:1") if reply is None else serving(reply)
    with server as address, pytest.raises(WorkerError, match=said):
        module.DaskCluster(address)


@pytest.mark.parametrize(
    "address", ["nonsense://x", "tcp://127.0.0.1", "x", "tls://127.0.0.1:8786"]
)
def test_refuses_addresses_that_nothing_can_have(address):
    with pytest.raises(InputError, match="scheduler is"):
        module.DaskCluster(address)


@pytest.mark.parametrize("what", ["scheduler killed", "scheduler stopped", "workers killed"])
def test_a_cluster_that_ends_half_way_is_given_up(tmp_path, monkeypatch, caplog, what):
    """What arrived before is kept; one error, without distributed's own messages."""
    with dask_processes(tmp_path) as (address, scheduler, worker):
        pool, seen = module.DaskCluster(address), []
        monkeypatch.setattr(module, "_PATIENCE", 4.0)  # now that its workers are there
        victim = worker if what == "workers killed" else scheduler
        sent = signal.SIGSTOP if what == "scheduler stopped" else signal.SIGKILL

        def run():
            for arrival in spread(chunks(slow_point, 2000), pool):
                assert not arrival.lost
                seen.extend(one.result for one in arrival.results)
                if len(seen) == 30:
                    os.kill(victim.pid, sent)

        with pytest.raises(WorkerError, match="no workers" if victim is worker else "answers"):
            run()
        pool.close()
    assert len(seen) == len(set(seen)) >= 30
    assert not caplog.records


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


@pytest.mark.long
def test_waiting_for_a_worker_does_not_count(cluster, tmp_path):
    """Chunks of three seconds behind others of three seconds, limit: half a second a start."""
    mark = partial(three_seconds_a_chunk, folder=tmp_path)
    todo = chunks(mark, 40)
    assert collected(cluster, todo, limit=0.5) == list(range(40))
    runs = [path.read_text().count("x") for path in sorted(tmp_path.iterdir())]
    assert runs == [1] * 40, "none was killed and run again"


def three_seconds_a_chunk(run, folder):
    with (folder / f"{run.index:03}").open("a") as file:
        file.write("x")
    time.sleep(0.3)
    return run.index
