"""Workers are killed and hang for real; every start comes back once, or is named as failed."""

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context, resource_tracker
from pathlib import Path
from unittest.mock import Mock

import casadi as ca
import numpy as np
import psutil
import pytest
from loky.backend.process import LokyProcess

from lockedjoint.nlp import executors
from lockedjoint.nlp.errors import WorkerError
from lockedjoint.nlp.executors import LocalExecutor, dispatch
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.starts import Chunk, Task, packed
from lockedjoint.nlp.submitter import Submitter

pytestmark = pytest.mark.processes
LOKY = tuple(int(number) for number in version("loky").split(".")[:2])


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
        if kind == "leave":
            os._exit(0)
        os.kill(os.getpid(), signal.SIGKILL)
    return run.index


def task_of(judge):
    return packed(Task(parabola, sample, {}, judge))


def chunks(payload, starts, size=10):
    return [Chunk(payload, 0, range(k, min(k + size, starts))) for k in range(0, starts, size)]


def collect(results):
    results = list(results)
    finished = sorted(value for result in results for value in result.finished.values())
    return finished, {start.index: start.reason for r in results for start in r.failed}


def end_processes():
    with LocalExecutor(1) as executor:
        executor.submit(int).result()
        executor.shutdown()


@pytest.fixture(scope="module", autouse=True)
def _end_processes():
    yield
    end_processes()


@pytest.fixture
def two():
    with LocalExecutor(2) as executor:
        yield executor


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        *((kind, "") for kind in ("die", "hang")),
        ("leave", "ended its process"),
        ("hang", "exceeded the time limit"),
    ],
)
def test_a_worker_that_fails_once_costs_nothing_and_always_one_start(
    tmp_path, two, kind, reason
):
    judge = partial(mischief, folder=tmp_path, kind=kind, bad=13, once=not reason)
    limit = 1.0 if kind == "hang" else None
    finished, failed = collect(dispatch(chunks(task_of(judge), 40), two, limit))
    assert (tmp_path / f"{kind}13").exists(), "it did fail"
    assert failed == ({13: reason} if reason else {})
    assert finished == [k for k in range(40) if k not in failed]


def test_multistart_names_the_start_that_kills(tmp_path):
    judge = partial(mischief, folder=tmp_path, kind="die", bad=3, once=False)
    with pytest.raises(WorkerError, match="Start 3 ended its process"):
        multistart(parabola, sample, starts=12, workers=2, judge=judge)


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def interrupt(request):
    """Return what sends this process a signal, which raises KeyboardInterrupt in its thread."""
    before = signal.signal(request.param, signal.default_int_handler)
    yield partial(os.kill, os.getpid(), request.param)
    signal.signal(request.param, before)


@pytest.mark.parametrize("explicit", [True, False])
def test_an_interrupted_submission_is_under_way_at_the_end(interrupt, monkeypatch, explicit):
    """The interrupt is heard at once; the submission ends after it, in a thread of its own."""
    failed, calls, heard = [], [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", failed.append)
    with LocalExecutor(1) as executor:
        executor.submit(int).result()
        submit = executor._pool.submit

        def interrupted(*call):
            time.sleep(0.2)  # until the main thread waits
            interrupt()
            heard.wait(10)
            time.sleep(0.2)
            calls.append(submit(*call))
            return calls[0]

        monkeypatch.setattr(executor._pool, "submit", interrupted)
        with pytest.raises(KeyboardInterrupt):
            executor.submit(time.sleep, 10)
        assert not calls
        heard.set()
        if explicit:
            executor.shutdown()
            assert calls[0].done()
    assert isinstance(calls[0].exception(), RuntimeError)
    assert not failed


def test_an_interrupt_while_a_process_starts_leaves_no_process(interrupt, monkeypatch):
    """Nobody would end it, and Python would wait for it without an end when it exits."""
    end_processes()
    start, started, blocked = LokyProcess.start, [], []

    def interrupted(process):
        start(process)
        started.append(process.pid)
        status = Path(f"/proc/{process.pid}/status")
        if status.exists():
            words = status.read_text(encoding="ascii").split()
            blocked.append(int(words[words.index("SigBlk:") + 1], 16))
        time.sleep(0.2)  # until the main thread waits
        interrupt()
        time.sleep(0.2)

    monkeypatch.setattr(LokyProcess, "start", interrupted)
    with pytest.raises(KeyboardInterrupt), LocalExecutor(1) as executor:
        executor.submit(time.sleep, 10)
    assert len(started) == 1
    assert not psutil.pid_exists(started[0])
    # It does not hear a Ctrl-C in the terminal: signal k is bit k − 1.
    ctrl_c = 1 << signal.SIGINT - 1
    assert all(mask & ctrl_c for mask in blocked)


def test_an_interrupt_while_the_second_thread_starts_ends_it(interrupt, monkeypatch):
    """Its pool would not know it, and Python would wait for it without an end."""
    start, started = threading.Thread.start, []

    def interrupted(thread):
        start(thread)
        if thread.name.startswith("submitter"):
            started.append(thread)
            interrupt()
            time.sleep(0.2)

    monkeypatch.setattr(threading.Thread, "start", interrupted)
    submitter = Submitter()
    with pytest.raises(KeyboardInterrupt):
        submitter.call(int)
    monkeypatch.undo()
    started[0].join(timeout=10)
    assert not started[0].is_alive()
    submitter.settle()
    assert submitter.call(abs, -3) == 3


def test_a_second_thread_that_cannot_start_processes_is_one_sentence(monkeypatch):
    def fails():
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(executors, "_SUBMITTER", Submitter())
    monkeypatch.setattr(resource_tracker, "ensure_running", fails)
    no_process = pytest.raises(WorkerError, match="No process can be started: no more")
    with no_process, LocalExecutor(1) as executor:
        executor.submit(int)
    monkeypatch.setattr(resource_tracker, "ensure_running", lambda: None)
    with LocalExecutor(1) as executor:
        assert executor.submit(int).result() == 0


@pytest.mark.skipif(LOKY < (3, 7), reason="before loky 3.7 all threads share one pool")
def test_a_thread_leaves_while_another_one_works():
    """They want other numbers of processes; an exception in one thread ends its own only."""
    begun = threading.Event()

    def works():
        with LocalExecutor(1) as executor:
            call = executor.submit(time.sleep, 5)
            begun.set()
            call.result()
            return time.monotonic()

    with ThreadPoolExecutor(1) as threads:
        ended = threads.submit(works)
        begun.wait(60)
        with suppress(ZeroDivisionError), LocalExecutor(2) as executor:
            executor.submit(int).result()
            raise ZeroDivisionError
        left = time.monotonic()
        assert left < ended.result()


def used_in_a_child(connection):
    executors._IDLE_SECONDS = 1.0
    with LocalExecutor(1) as executor:
        connection.send(executor.submit(abs, -4).result())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_child_has_processes_of_its_own():
    with LocalExecutor(1) as executor:
        executor.submit(int).result()
    here, there = get_context("fork").Pipe()
    child = get_context("fork").Process(target=used_in_a_child, args=(there,))
    child.start()
    assert here.poll(60)
    assert here.recv() == 4
    child.join(60)
    assert child.exitcode == 0


def test_a_shutdown_waits_until_the_pool_has_seen_that_a_call_is_cancelled():
    """An interrupt right after a call was submitted cancels it before that."""
    call, seen = Future(), []
    executor = LocalExecutor(1)
    executor._pool = Mock(
        submit=Mock(return_value=call),
        shutdown=lambda **_: seen.append(wait([call], 0).done),
    )
    executor.submit(int)
    call.cancel()
    threading.Timer(0.1, call.set_running_or_notify_cancel).start()
    executor.shutdown()
    assert seen == [{call}]


def test_a_worker_ends_with_sigterm():
    """Which is blocked while it starts."""
    with LocalExecutor(1) as executor:
        worker = psutil.Process(executor.submit(os.getpid).result())
        worker.terminate()
        assert worker.wait(timeout=60) is not None or not worker.is_running()


def slow_parabola():
    time.sleep(1)
    return parabola()


def test_building_does_not_count_as_running(two):
    payload = packed(Task(slow_parabola, sample, {}, index_of))
    assert collect(dispatch(chunks(payload, 20), two, 0.2)) == (list(range(20)), {})


def test_idle_processes_serve_the_next_call_and_then_end(monkeypatch):
    monkeypatch.setattr(executors, "_IDLE_SECONDS", 1.0)
    end_processes()
    workers = []
    for _ in range(2):
        with LocalExecutor(1) as executor:
            workers.append(executor.submit(os.getpid).result())
    assert workers[0] == workers[1]
    deadline = time.monotonic() + 60
    while psutil.pid_exists(workers[0]) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not psutil.pid_exists(workers[0])


def test_calls_that_were_just_made_end_without_a_traceback(monkeypatch):
    failed = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    for _ in range(3):
        with LocalExecutor(2) as executor:
            executor.submit(os.getpid).result()
            late = [executor.submit(time.sleep, 60) for _ in range(3)]
        assert all(isinstance(call.exception(), RuntimeError) for call in late)
    assert not failed


def grow():
    time.sleep(1.1)  # loky measures the memory once a second
    vars(executors).setdefault("kept_by_the_test", []).append(b"x" * 400_000_000)
    return os.getpid()


def test_a_process_that_grows_is_replaced():
    """Where warnings are errors, as in these tests, loky's thread ended of its own."""
    with LocalExecutor(1) as executor:
        calls = [executor.submit(grow) for _ in range(4)]
        assert len({call.result(timeout=60) for call in calls}) == 2
    end_processes()


def test_threads_share_the_processes():
    """Also with another number of processes each: all calls of every thread come back."""

    def found(size):
        with LocalExecutor(size) as executor:
            return collect(dispatch(chunks(task_of(index_of), 40), executor))

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(found, (1, 2, 1, 2))) == [(list(range(40)), {})] * 4


def workers_of(process=None):
    workers = []
    for child in (process or psutil.Process()).children():
        with suppress(psutil.ZombieProcess):  # one that has ended, and that nobody waited for
            workers += [child] * ("popen_loky" in " ".join(child.cmdline()))
    return workers


ORPHANS = """
import os, sys, time
sys.path.insert(0, {root!r})
from pathlib import Path
import casadi as ca
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem

def build():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))

def hang(rng):
    Path({folder!r}, str(os.getpid())).touch()
    time.sleep(600)

multistart(build, hang, starts=2, workers=2)
"""


def test_workers_that_hang_end_with_a_killed_parent(tmp_path):
    script = ORPHANS.format(root=str(Path(__file__).parents[2]), folder=str(tmp_path))
    process = subprocess.Popen([sys.executable, "-c", script])
    deadline = time.monotonic() + 120
    while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < deadline:
        time.sleep(0.1)
    workers = [psutil.Process(int(mark.name)) for mark in tmp_path.iterdir()]
    process.kill()
    process.wait(timeout=120)
    assert len(workers) == 2
    assert not psutil.wait_procs(workers, timeout=120)[1]


def test_all_workers_killed_from_outside(two):
    payload, seen = task_of(index_of), []
    for result in dispatch(chunks(payload, 200), two):
        seen += result.finished.values()
        if len(seen) in (20, 100):
            for child in workers_of():
                child.kill()
    assert sorted(seen) == list(range(200))


def fails(run, bad):
    if run.index in bad:
        np.linalg.inv(np.zeros((2, 2)))
    return run.index


def test_an_exception_loses_its_start_only(two):
    payload = task_of(partial(fails, bad=(3, 14)))
    finished, failed = collect(dispatch(chunks(payload, 40), two))
    assert failed == dict.fromkeys((3, 14), "raised LinAlgError: Singular matrix")
    assert finished == [k for k in range(40) if k not in failed]


@pytest.mark.parametrize("workers", [1, 2])
def test_multistart_passes_exceptions_on(workers):
    with pytest.raises(np.linalg.LinAlgError):
        multistart(parabola, sample, starts=12, workers=workers, judge=partial(fails, bad=(3,)))


def test_errors_of_building_are_passed_on(two):
    payload = packed(Task(partial(np.linalg.inv, np.zeros((2, 2))), sample, {}, index_of))
    with pytest.raises(np.linalg.LinAlgError):
        list(dispatch(chunks(payload, 20), two))


def test_draws_chunks_only_as_workers_ask(two):
    payload, drawn = task_of(index_of), itertools.count()
    endless = (Chunk(payload, 0, range(10 * k, 10 * k + 10)) for k in drawn)
    results = dispatch(endless, two)
    for _ in range(30):
        next(results)
    results.close()
    assert next(drawn) <= 30 + 4


def test_any_executor_will_do():
    """The same starts on processes of the standard library, and on threads."""
    payload = task_of(index_of)
    spawned = partial(ProcessPoolExecutor, 2, mp_context=get_context("spawn"))
    for make in (spawned, partial(ThreadPoolExecutor, 2)):
        with make() as executor:
            assert collect(dispatch(chunks(payload, 40), executor)) == (list(range(40)), {})
            study = multistart(parabola, sample, starts=12, executor=executor, judge=index_of)
    assert study.results == tuple(range(12))


def test_another_executor_that_broke_says_so(tmp_path):
    payload = task_of(partial(mischief, folder=tmp_path, kind="die", bad=3, once=False))
    with (
        ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor,
        pytest.raises(WorkerError, match="takes no more work"),
    ):
        list(dispatch(chunks(payload, 40), executor))


def test_a_time_limit_never_ends_the_callers_process(tmp_path):
    """Threads share it: there a start runs on."""
    payload = task_of(lambda run: time.sleep(0.3) or run.index)
    with ThreadPoolExecutor(2) as executor:
        results = dispatch(chunks(payload, 4, size=2), executor, 0.1)
        assert collect(results) == (list(range(4)), {})
