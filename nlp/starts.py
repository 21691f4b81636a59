"""What is done at every start, and chunks of starts as workers receive them."""

import faulthandler
import os
import pickle
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import IO, Any, Generic, TypeVar
from uuid import uuid4

import cloudpickle
import numpy as np
from threadpoolctl import ThreadpoolController

from nlp.arrays import FloatArray, Rng, whole_number
from nlp.errors import InputError, WorkerError
from nlp.options import check_options
from nlp.problem import Problem
from nlp.solution import Solution
from nlp.solver import Solver

T = TypeVar("T")

# Seconds that building a solver may take where starts have a time limit.
_SET_UP = 60.0
_IMPORT = uuid4().hex


@dataclass(frozen=True, eq=False)
class Run:
    """One start and what came of it.

    Attributes
    ----------
    seed, index
        Seed of the starts and number of this one.
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
        Draws a start from a generator, in the variables that `Problem.complete_start` takes; or
        the starts themselves, shape (starts, variables).
    options
        The solver's options, over those of the problem.
    judge
        Makes a result of a run, where it was run.
    solver_name, compiled
        See `nlp.solver.Solver`.

    Raises
    ------
    InputError
        If there is no such solver, or `compiled` is neither true nor false.
    SolverOptionError
        If an option or its value is not one of the solver's.
    """

    build: Callable[[], Problem]
    sample: Callable[[np.random.Generator], FloatArray] | FloatArray
    options: Mapping[str, object]
    judge: Callable[[Run], T]
    solver_name: str = "ipopt"
    compiled: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.compiled, bool):
            raise InputError("compiled", self.compiled, "true or false")
        checked = check_options(self.options, self.solver_name)
        object.__setattr__(self, "options", checked)

    def solver(self) -> Solver:
        """Build the problem and its solver."""
        return Solver(self.build(), self.options, self.solver_name, self.compiled)

    def start(self, seed: int, index: int) -> FloatArray:
        """Return start `index` of a seed."""
        if callable(self.sample):
            return self.sample(generator(seed, index))
        return np.asarray(self.sample[index], dtype=float)


@dataclass(frozen=True, eq=False)
class FinishedStart(Generic[T]):
    """A start that ended."""

    index: int
    result: T


@dataclass(frozen=True, eq=False)
class FailedStart:
    """A start without a result.

    Attributes
    ----------
    index
        Number of the start.
    reason
        In words that follow 'the start'.
    error
        The exception that it raised; None if it ended its process or exceeded the time limit.
    """

    index: int
    reason: str
    error: Exception | None = None


@dataclass(frozen=True)
class Chunk:
    """Some starts of one task, in a form that travels.

    Attributes
    ----------
    payload
        The task, from `packed`.
    seed
        Seed of the starts.
    indices
        Numbers of the starts.
    label
        The sender's own; workers ignore it.
    """

    payload: bytes
    seed: int
    indices: Sequence[int]
    label: int = 0


def seed_of(seed: Rng | None = None, rng: Rng | None = None) -> int:
    """Return the seed that a caller's ``seed=`` or ``rng=`` stands for; 0 by default.

    Start k is a function of the seed and of k alone.

    Parameters
    ----------
    seed, rng
        A whole number of at least 0; or a generator, from which one number is drawn. At most
        one of both.

    Raises
    ------
    InputError
        If it is neither, or both are given.
    """
    if seed is not None and rng is not None:
        raise InputError("rng", rng, "left out where a seed is given")
    name, given = ("seed", seed) if rng is None else ("rng", rng)
    if isinstance(given, np.random.Generator):
        return int(given.integers(2**63))
    return 0 if given is None else whole_number(name, given, 0)


def generator(seed: int, index: int) -> np.random.Generator:
    """Return the random generator of start `index` of a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))


def packed(task: Task[Any]) -> bytes:
    """Return the task in a form that travels; InputError if it has none."""
    try:
        return bytes(cloudpickle.dumps(task))  # takes functions of a script or notebook
    except Exception as reason:  # of whatever is in the task, such as symbols
        allowed = "functions that can be sent to other processes"
        raise InputError("build, sample or judge", str(reason), allowed) from None


def run_start(solver: Solver, task: Task[T], seed: int, index: int) -> FinishedStart[T]:
    """Draw a start, solve from it and judge the answer."""
    began = time.process_time()
    solution = solver.solve(task.start(seed, index))
    run = Run(seed, index, solution, time.process_time() - began)
    return FinishedStart(index, task.judge(run))


Outcomes = list[FinishedStart[Any] | FailedStart] | Exception


@dataclass(frozen=True)
class RunChunk:
    """The function that workers call: run a chunk; the solver is kept for the next one.

    Parameters
    ----------
    time_limit
        Seconds that a start may take. After that its process is ended, by a thread that needs
        no interpreter lock, so also where compiled code does not return. Not where the process
        is the caller's own. No limit by default.
    sender
        The process of the caller.
    """

    time_limit: float | None = None
    sender: str = field(default_factory=lambda: _process())

    def __call__(self, chunk: Chunk) -> bytes:
        """Return the pickled `Outcomes`: an exception in one start loses that start only.

        The exception that building the problem raised stands for all of them.
        """
        try:
            self._limit(_SET_UP)
            solver, task, libraries = _unpacked(chunk.payload)
            # A cluster's workers are not ours to set up; where they are, this changes nothing.
            with libraries.limit(limits=1, user_api="blas"):
                starts = [self._run(solver, task, chunk.seed, k) for k in chunk.indices]
            return bytes(cloudpickle.dumps(starts))
        except Exception as error:
            return bytes(cloudpickle.dumps(_portable(error)))
        finally:
            if self._limited:
                faulthandler.cancel_dump_traceback_later()

    @property
    def _limited(self) -> bool:
        return self.time_limit is not None and self.sender != _process()

    def _run(
        self, solver: Solver, task: Task[Any], seed: int, index: int
    ) -> FinishedStart[Any] | FailedStart:
        self._limit(0.0)
        try:
            return run_start(solver, task, seed, index)
        except Exception as error:
            said = f"raised {type(error).__name__}: {error}"
            return FailedStart(index, said, _portable(error))

    def _limit(self, least: float) -> None:
        if self._limited and self.time_limit is not None:
            seconds = max(self.time_limit, least)
            faulthandler.dump_traceback_later(seconds, exit=True, file=_nowhere())


def _process() -> str:
    """Return a name of this process among all of a cluster, forked ones included."""
    return f"{_IMPORT}-{os.getpid()}"


@lru_cache(maxsize=1)
def _nowhere() -> IO[str]:
    return open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123


@lru_cache(maxsize=2)
def _unpacked(payload: bytes) -> tuple[Solver, Task[Any], ThreadpoolController]:
    task: Task[Any] = pickle.loads(payload)
    solver = task.solver()
    # Looked for once, and when the solver has brought its own: that takes milliseconds.
    return solver, task, ThreadpoolController()


def _portable(error: Exception) -> Exception:
    """Return the exception if it can cross to another process, else a WorkerError like it.

    Where it can, its traceback goes along as a note.
    """
    try:
        error.add_note(traceback.format_exc())
        pickle.loads(cloudpickle.dumps(error))
    except Exception:
        return WorkerError(f"{type(error).__name__}: {error}")
    return error
