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

from lockedjoint.nlp.arrays import FloatArray, Rng, whole_number
from lockedjoint.nlp.errors import InputError, WorkerError
from lockedjoint.nlp.options import check_options
from lockedjoint.nlp.problem import Problem, Solution
from lockedjoint.nlp.solver import Solver

T = TypeVar("T")

# Seconds that building a solver may take where starts have a time limit; a longer limit counts
# for it, too.
_SET_UP_SECONDS = 60.0
# A name of this import of the module; forked processes share it.
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
    """What every worker needs; see `lockedjoint.nlp.multistart.multistart`.

    Its options are checked.
    """

    build: Callable[[], Problem]
    sample: Callable[[np.random.Generator], FloatArray] | FloatArray
    options: Mapping[str, object]
    judge: Callable[[Run], T]
    solver_name: str = "ipopt"
    first: int = 0  #: Number of the start that the first row of `sample` is, if it has rows.

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", check_options(self.options, self.solver_name))

    def solver(self) -> Solver:
        """Build the problem and its solver."""
        return Solver(self.build(), self.options, self.solver_name)

    def result(self, solver: Solver, seed: int, index: int) -> T:
        """Draw a start, solve from it and judge the answer."""
        began = time.process_time()
        given = self.sample
        start = given(generator(seed, index)) if callable(given) else given[index - self.first]
        solution = solver.solve(start)
        return self.judge(Run(seed, index, solution, time.process_time() - began))


@dataclass(frozen=True, eq=False)
class FailedStart:
    """A start without a result: why, in words that follow 'the start', and what it raised."""

    index: int
    reason: str
    error: Exception | None = None


@dataclass(frozen=True)
class Chunk:
    """Starts of one task, from `packed`, in a form that travels; the label is the sender's."""

    payload: bytes
    seed: int
    indices: Sequence[int]
    label: int = 0


@dataclass(frozen=True)
class ChunkResult:
    """What came of a chunk, or of a part of it: results by start, and starts that failed."""

    label: int = 0
    finished: Mapping[int, Any] = field(default_factory=dict)
    failed: Sequence[FailedStart] = ()


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


def _process() -> str:
    """Return a name of this process among all of a cluster, forked ones included."""
    return f"{_IMPORT}-{os.getpid()}"


@dataclass(frozen=True)
class RunChunk:
    """The function that workers call: run a chunk; the solver is kept for the next one.

    After so many seconds in one start its process is ended, by a thread that needs no
    interpreter lock, so also where compiled code does not return. Not the sender's own process.
    """

    time_limit: float | None = None
    sender: str = field(default_factory=_process)

    def __call__(self, chunk: Chunk) -> bytes:
        """Return a ChunkResult, or what building the problem raised; pickled."""
        finished: dict[int, Any] = {}
        failed: list[FailedStart] = []
        try:
            self._limit(_SET_UP_SECONDS)
            solver, task, libraries = _unpacked(chunk.payload)
            # A cluster's workers are not ours to set up; where they are, this changes nothing.
            with libraries.limit(limits=1, user_api="blas"):
                for index in chunk.indices:
                    self._limit()
                    try:
                        finished[index] = task.result(solver, chunk.seed, index)
                    except Exception as error:
                        reason = f"raised {type(error).__name__}: {error}"
                        failed.append(FailedStart(index, reason, _portable(error)))
            return bytes(cloudpickle.dumps(ChunkResult(chunk.label, finished, failed)))
        except Exception as error:
            return bytes(cloudpickle.dumps(_portable(error)))
        finally:
            if self._limited:
                faulthandler.cancel_dump_traceback_later()

    @property
    def _limited(self) -> bool:
        """Whether there is a limit here: not in the sender's own process."""
        return self.time_limit is not None and self.sender != _process()

    def _limit(self, least: float = 0.0) -> None:
        """Begin the time limit anew, `least` seconds at least."""
        if self._limited and self.time_limit is not None:
            seconds = max(self.time_limit, least)
            faulthandler.dump_traceback_later(seconds, exit=True, file=_nowhere())


@lru_cache(maxsize=1)
def _nowhere() -> IO[str]:
    """Return a file that keeps nothing: faulthandler writes a traceback to it."""
    return open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123


@lru_cache(maxsize=2)
def _unpacked(payload: bytes) -> tuple[Solver, Task[Any], ThreadpoolController]:
    """Return the solver of a task, the task, and what limits threads of linear algebra."""
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
