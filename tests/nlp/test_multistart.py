"""Starts are the same whoever runs them, and an interrupt loses only what was under way."""

import io
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout, suppress
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from lockedjoint.nlp.arrays import one_blas_thread
from lockedjoint.nlp.errors import InputError, SolverOptionError
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.solver import Solver
from lockedjoint.nlp.starts import generator, seed_of


def rosenbrock():
    x = ca.SX.sym("x", 2)
    return Problem("rosenbrock", x, (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)


def sample(rng):
    return rng.normal(size=2)


def start_of(run):
    return run.index, run.solution.variables.tobytes()


def test_any_number_of_workers_gives_the_same_bytes():
    studies = [
        multistart(rosenbrock, sample, starts=25, seed=7, workers=workers)
        for workers in (1, 2, 3)
    ]
    points = [[run.solution.variables.tobytes() for run in s.results] for s in studies]
    assert points[0] == points[1] == points[2]
    assert [run.index for run in studies[1].results] == list(range(25))
    assert all(study.complete for study in studies)
    for run in studies[0].results:
        np.testing.assert_allclose(run.solution.variables, [1, 1], atol=1e-6)


def test_start_k_does_not_depend_on_how_many_there_are():
    few = multistart(rosenbrock, sample, starts=3, rng=1, judge=start_of)
    more = multistart(rosenbrock, sample, starts=6, rng=1, judge=start_of)
    assert few.results == more.results[:3]
    other = multistart(rosenbrock, sample, starts=3, rng=2, judge=start_of)
    assert set(other.results).isdisjoint(few.results)


@pytest.mark.parametrize("workers", [1, 2])
def test_rows_begin_at_the_first_start(workers):
    rows = np.array([[1.0, 2.0], [1.5, -1.0], [0.5, 0.5]])
    given = multistart(rosenbrock, rows, first=7, workers=workers)
    assert [run.index for run in given.results] == [7, 8, 9]
    one_by_one = [multistart(rosenbrock, row[None]).results[0] for row in rows]
    for run, alone in zip(given.results, one_by_one, strict=True):
        np.testing.assert_array_equal(run.solution.variables, alone.solution.variables)


def test_generators_differ_between_starts_and_seeds():
    draws = {(s, k): generator(s, k).normal() for s in range(5) for k in range(5)}
    assert len(set(draws.values())) == 25
    assert draws[3, 4] == generator(3, 4).normal()


def test_a_generator_gives_one_seed():
    drawn = int(np.random.default_rng(5).integers(2**63))
    study = multistart(rosenbrock, sample, starts=2, rng=np.random.default_rng(5))
    assert [run.seed for run in study.results] == [drawn] * 2
    assert seed_of(np.int64(3)) == 3
    assert seed_of(rng=3) == seed_of(3) == 3
    with pytest.raises(InputError, match="left out where a seed is given"):
        seed_of(seed=1, rng=1)


def test_later_starts_are_those_of_a_longer_run():
    whole = multistart(rosenbrock, sample, starts=6, seed=4)
    rest = multistart(rosenbrock, sample, first=2, starts=4, seed=4, workers=2)
    assert [run.index for run in rest.results] == [2, 3, 4, 5]
    for run, same in zip(rest.results, whole.results[2:], strict=True):
        assert run.solution.variables.tobytes() == same.solution.variables.tobytes()


def test_starts_may_be_given():
    points = [[0.5, 0.5], [2.0, -1.0], [0.0, 0.0]]
    study = multistart(rosenbrock, points, workers=2)
    assert [run.index for run in study.results] == [0, 1, 2]
    for run, point in zip(study.results, points, strict=True):
        alone = Solver(rosenbrock()).solve(point)
        assert run.solution.variables.tobytes() == alone.variables.tobytes()
    for wrong in ([1.0, 2.0], [[1.0]] * 2):
        with pytest.raises(InputError, match="one row for each start"):
            multistart(rosenbrock, wrong, starts=3)


def test_refuses_bad_options_before_any_work():
    with pytest.raises(SolverOptionError):
        multistart(rosenbrock, sample, starts=1, options={"nonsense": 1})


def test_a_start_that_takes_too_long_is_stopped():
    limit = {"max_wall_time": 1e-6}
    study = multistart(rosenbrock, sample, starts=2, options=limit)
    ended = {run.solution.status.return_status for run in study.results}
    assert ended == {"Maximum_WallTime_Exceeded"}


def test_functions_of_a_script_reach_the_workers():
    here = multistart(lambda: rosenbrock(), lambda rng: rng.normal(size=2), starts=4, workers=2)
    assert [start_of(run) for run in here.results] == list(
        multistart(rosenbrock, sample, starts=4, judge=start_of).results
    )


def test_says_so_when_a_task_cannot_be_sent_to_workers():
    handle = threading.Lock()
    with pytest.raises(InputError, match="sent to other processes"):
        multistart(lambda: handle and rosenbrock(), sample, starts=2, workers=2)


SCRIPT = """
import sys
sys.path.insert(0, {root!r})
from dataclasses import dataclass
import casadi as ca
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.solver import Solver

@dataclass
class Found:
    index: int

def build():
    x = ca.SX.sym("x", 2)
    return Problem("parabola", x, ca.sumsqr(x - 1))

study = multistart(build, lambda rng: rng.normal(size=2), starts=30, workers=2,
                   judge=lambda run: Found(run.index))
print(study.results == tuple(map(Found, range(30))))
"""


def test_a_script_needs_no_guard_and_may_use_its_own_classes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(root=str(Path(__file__).parents[2])))
    command = [sys.executable, script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert (done.stdout, done.stderr) == ("True\n", "")


SLOW = """
import sys
sys.path.insert(0, {root!r})
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from functools import partial
from lockedjoint.formulations import max_min
from lockedjoint.formulations.joints.models import arm
from lockedjoint.nlp.multistart import multistart
if __name__ == "__main__":
    seven = arm("unit-revolute", 7)
    def arrived(run):
        if run.index == 0:
            print("a result", flush=True)
        return 0.0
    study = multistart(partial(max_min.build, seven), seven.sample, starts=100_000,
                       workers={workers}, figure=arrived)
    indices = [run.index for run in study.results]
    print(len(indices), study.complete, len(set(indices)) == len(indices), flush=True)
"""


@pytest.mark.processes
@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_what_is_done(workers):
    root = str(Path(__file__).parents[2])
    words = [sys.executable, "-c", SLOW.format(root=root, workers=workers)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(words, **pipes, start_new_session=True)
    assert process.stdout.readline().strip() == "a result"
    for _ in range(4):  # as at this very moment a Ctrl-C can be lost, a user presses it again
        os.killpg(process.pid, signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            out, err = process.communicate(timeout=30)
            break
    else:
        os.killpg(process.pid, signal.SIGKILL)
        pytest.fail("Ctrl-C was not answered")
    assert process.returncode == 0, err
    count, *said = out.split()
    assert int(count) > 0
    assert said == ["False", "True"]  # not complete; every start once


def test_ctrl_c_after_the_last_start_is_answered():
    """The results are all there, and the study still says that the user interrupted."""

    def until(index):
        if index == 2:
            raise KeyboardInterrupt
        return index

    study = multistart(rosenbrock, sample, starts=3, judge=lambda run: until(run.index))
    assert (study.results, study.complete) == ((0, 1), False)
    study = multistart(rosenbrock, sample, starts=3, judge=lambda run: run.index, figure=until)
    assert (study.results, study.complete) == ((0, 1, 2), False)


def blas_threads(run):
    np.linalg.norm(np.eye(2))
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_starts_are_solved_on_one_thread_each_and_only_they():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads(None)
        study = multistart(rosenbrock, sample, starts=3, judge=blas_threads)
        assert study.results == ({1},) * 3
        assert blas_threads(None) == before


def test_blocks_that_overlap_leave_the_limit_as_it_was():
    """As those of two threads do."""
    first, second = one_blas_thread(), one_blas_thread()
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads(None)
        for block in (first, second):
            block.__enter__()
            assert blas_threads(None) == {1}
        for block, left in ((first, {1}), (second, before)):
            block.__exit__(None, None, None)
            assert blas_threads(None) == left


def test_runs_of_eight_threads_leave_the_process_alone():
    """Streams, signals, environment and folder are the user's; every run gives its answer."""

    def runs(seed):
        print("begun")
        points = {point(seed) for _ in range(10)}
        print("ended")
        return points

    def point(seed):
        [run] = multistart(rosenbrock, sample, starts=1, seed=seed).results
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
