"""What is done at every start, and chunks of starts as workers are sent them."""

import math
import pickle
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, TypeVar

import cloudpickle
import numpy as np
from threadpoolctl import ThreadpoolController

from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError, WorkerError
from nlp.options import check_options
from nlp.problem import Problem, Sense
from nlp.solution import Solution
from nlp.solver import Solver

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
    solver_name, compiled, allow_files
        See `nlp.solver.Solver`.

    Raises
    ------
    InputError
        If there is no such solver, or `compiled` is neither true nor false.
    SolverOptionError
        If an option or its value is not one of the solver's.
    """

    build: Callable[[], Problem]
    sample: Callable[[np.random.Generator], FloatArray]
    options: Mapping[str, object]
    judge: Callable[[Run], T]
    solver_name: str = "ipopt"
    compiled: bool = False
    allow_files: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.compiled, bool):
            raise InputError("compiled", self.compiled, "true or false")
        checked = check_options(self.options, self.solver_name, self.allow_files)
        object.__setattr__(self, "options", checked)

    def solver(self) -> Solver:
        """Build the problem and its solver."""
        return Solver(
            self.build(), self.options, self.solver_name, self.compiled, self.allow_files
        )


@dataclass(frozen=True, eq=False)
class Done(Generic[T]):
    """A start that ended; its objective is NaN if the solver did not succeed."""

    index: int
    result: T
    sense: Sense
    objective: float


@dataclass(frozen=True, eq=False)
class Lost:
    """A start without a result.

    Attributes
    ----------
    index
        Number of the start.
    why
        The reason, in words that follow 'the start'.
    error
        The exception that it raised; None if it ended its process or ran too long.
    """

    index: int
    why: str
    error: Exception | None = None


Outcomes = list[Done[Any] | Lost]


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


def seed_of(rng: int | np.integer[Any] | np.random.Generator) -> int:
    """Return the seed that `rng` stands for, so that start k is a function of it and k alone.

    Parameters
    ----------
    rng
        A seed, a whole number of at least 0; or a generator, from which one number is drawn.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(2**63))
    return whole_number("rng", rng, 0)


def generator(seed: int, index: int) -> np.random.Generator:
    """Return the random generator of start `index` of a study with this `seed`."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))


def packed(task: Task[Any]) -> bytes:
    """Return the task in a form that travels; InputError if it has none."""
    try:
        return bytes(cloudpickle.dumps(task))  # takes functions of a script or notebook
    except (pickle.PicklingError, AttributeError, TypeError) as reason:
        allowed = "functions that can be sent to other processes"
        raise InputError("build, sample or judge", str(reason), allowed) from None


def run_chunk(payload: bytes, seed: int, indices: Sequence[int]) -> Outcomes:
    """Run the starts of a chunk in this process; the solver is kept for the next chunk.

    Without starts it only builds the solver. An exception in one start loses that start only.
    """
    with _ONE_AT_A_TIME:
        solver, task, libraries = _unpacked(payload)
        # A cluster's workers are not ours to set up; where they are, this changes nothing.
        with libraries.limit(limits=1, user_api="blas"):
            return [_run_or_lose(solver, task, seed, index) for index in indices]


@lru_cache(maxsize=2)
def _unpacked(payload: bytes) -> tuple[Solver, Task[Any], ThreadpoolController]:
    task: Task[Any] = pickle.loads(payload)
    solver = task.solver()
    # Looked for once, and when the solver has brought its own: that takes milliseconds.
    return solver, task, ThreadpoolController()


def run_start(solver: Solver, task: Task[T], seed: int, index: int) -> Done[T]:
    """Draw a start, solve from it and judge the answer."""
    began = time.process_time()
    solution = solver.solve(task.sample(generator(seed, index)))
    run = Run(seed, index, solution, time.process_time() - began)
    objective = solution.objective if solution.status.success else math.nan
    return Done(index, task.judge(run), solution.sense, objective)


def _run_or_lose(solver: Solver, task: Task[Any], seed: int, index: int) -> Done[Any] | Lost:
    try:
        return run_start(solver, task, seed, index)
    except Exception as error:
        return Lost(index, f"raised {type(error).__name__}: {error}", portable(error))


def portable(error: Exception) -> Exception:
    """Return the exception if it can cross to another process, else a WorkerError like it.

    Where it can, its traceback goes along as a note.
    """
    try:
        error.add_note(traceback.format_exc())
        pickle.loads(cloudpickle.dumps(error))
    except Exception:
        return WorkerError(f"{type(error).__name__}: {error}")
    return error
