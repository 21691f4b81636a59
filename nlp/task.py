"""What is done at every start, and chunks of starts as workers are sent them."""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, TypeVar

import cloudpickle
import numpy as np
from threadpoolctl import ThreadpoolController

from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.nlpsol import NlpsolSolver
from nlp.problem import Problem, Sense
from nlp.solution import Solution
from nlp.solvers import build_solver

T = TypeVar("T")

# MUMPS keeps global state: in one process, one chunk at a time, whatever threads there are.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, eq=False)
class Run:
    """One start and what came of it.

    Attributes
    ----------
    seed, index
        Seed of the study and number of the start in it.
    solution
        The solver's answer.
    cpu_seconds
        Processor time of drawing the start and solving from it, without building the solver.
    """

    seed: int
    index: int
    solution: Solution
    cpu_seconds: float


@dataclass(frozen=True)
class Task(Generic[T]):
    """What every worker needs.

    Attributes
    ----------
    build
        Builds the problem; called once per worker.
    sample
        Draws a start from a generator, in the variables that the problem's lift takes.
    options
        The solver's options.
    judge
        Makes a result of a run, where it was run.
    solver_name, compiled
        See `nlp.solvers`.
    """

    build: Callable[[], Problem]
    sample: Callable[[np.random.Generator], FloatArray]
    options: Mapping[str, object]
    judge: Callable[[Run], T]
    solver_name: str = "ipopt"
    compiled: bool = False

    def solver(self) -> NlpsolSolver:
        """Build the problem and its solver."""
        return build_solver(self.build(), self.solver_name, self.options, self.compiled)


@dataclass(frozen=True, eq=False)
class Done(Generic[T]):
    """A start that ended: what the judge made of it, and what a progress bar shows."""

    index: int
    result: T
    success: bool
    sense: Sense
    objective: float


@dataclass(frozen=True)
class Chunk:
    """Some starts of one task, in a form that travels.

    Attributes
    ----------
    payload
        The task, from `packed`.
    seed
        Seed of the study.
    indices
        Numbers of the starts.
    label
        The sender's own; workers ignore it.
    """

    payload: bytes
    seed: int
    indices: Sequence[int]
    label: int = 0


def generator(seed: int, index: int) -> np.random.Generator:
    """Return the random generator of start `index` of a study with this `seed`."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))


def packed(task: Task[Any]) -> bytes:
    """Return the task in a form that travels; InputError if it has none."""
    try:
        content: bytes = cloudpickle.dumps(task)  # takes functions of a script or notebook
    except (pickle.PicklingError, AttributeError, TypeError) as reason:
        allowed = "functions that can be sent to other processes"
        raise InputError("build, sample or judge", str(reason), allowed) from None
    return content


def run_chunk(payload: bytes, seed: int, indices: Sequence[int]) -> list[Done[Any]]:
    """Run the starts of a chunk in this process; the solver is kept for the next chunk."""
    with _ONE_AT_A_TIME:
        solver, task, libraries = _unpacked(payload)
        # A cluster's workers are not ours to set up; where they are, this changes nothing.
        with libraries.limit(limits=1, user_api="blas"):
            return [run_start(solver, task, seed, index) for index in indices]


@lru_cache(maxsize=2)
def _unpacked(payload: bytes) -> tuple[NlpsolSolver, Task[Any], ThreadpoolController]:
    task: Task[Any] = pickle.loads(payload)
    solver = task.solver()
    # Looked for once, and when the solver has brought its own: that takes milliseconds.
    return solver, task, ThreadpoolController()


def run_start(solver: NlpsolSolver, task: Task[T], seed: int, index: int) -> Done[T]:
    """Draw a start, solve from it and judge what came of it."""
    began = time.process_time()
    solution = solver.solve(task.sample(generator(seed, index)))
    run = Run(seed, index, solution, time.process_time() - began)
    success = solution.status.success
    return Done(index, task.judge(run), success, solution.sense, solution.objective)
