"""Linear algebra runs on one thread where starts are solved, and only there."""

import io
import os
import pickle
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from nlp.arrays import one_blas_thread
from nlp.multistart import multistart
from nlp.problem import Problem
from nlp.starts import Chunk, RunChunk, Task, packed


def parabola():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))


def sample(rng):
    return rng.normal(size=2)


def threads(run=None):
    """Threads of each library of linear algebra in this process."""
    np.linalg.norm(np.eye(2))
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def _two_threads_outside(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")  # for worker processes
    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()  # the library that comes with SCS always says 1, once it is loaded
        if 2 not in before:
            pytest.skip("NumPy's linear algebra has one thread: install its wheel")
        yield
        assert threads() == before, "as it was"


@pytest.mark.parametrize("workers", [1, 2])
def test_starts_are_solved_on_one_thread_each(workers):
    study = multistart(parabola, sample, starts=3, workers=workers, judge=threads)
    assert study.results == ({1},) * 3


def test_chunks_are_whoever_runs_them():
    chunk = Chunk(packed(Task(parabola, sample, {}, threads)), 0, range(2))
    done = pickle.loads(RunChunk()(chunk))
    assert done.finished == {0: {1}, 1: {1}}


def test_the_decorator_limits_and_lets_go():
    limited = one_blas_thread()(threads)
    assert limited() == {1}
    assert limited.__doc__ == threads.__doc__


def test_blocks_that_overlap_leave_the_limit_as_it_was():
    """As those of two threads do."""
    first, second = one_blas_thread(), one_blas_thread()
    before = threads()
    for block in (first, second):
        block.__enter__()
        assert threads() == {1}
    first.__exit__(None, None, None)
    assert threads() == {1}
    second.__exit__(None, None, None)
    assert threads() == before


def test_a_thousand_runs_of_eight_threads_leave_the_process_alone():
    """Streams, signals, environment and folder are the user's; every run gives its answer."""

    def runs(seed):
        print("begun")
        points = {point(seed) for _ in range(125)}
        print("ended")
        return points

    def point(seed):
        [run] = multistart(parabola, sample, starts=1, seed=seed).results
        return run.solution.variables.tobytes()

    def process():
        handlers = [signal.getsignal(number) for number in signal.valid_signals()]
        return sys.stdout, sys.stderr, handlers, dict(os.environ), Path.cwd()

    before = process()
    with ThreadPoolExecutor(8) as pool, redirect_stdout(io.StringIO()) as said:
        inside = sys.stdout
        found = list(pool.map(runs, range(8)))
        assert sys.stdout is inside
    assert found == [{point(seed)} for seed in range(8)]
    assert sorted(said.getvalue().split()) == ["begun"] * 8 + ["ended"] * 8
    assert process() == before
