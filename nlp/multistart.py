"""One problem from many random starts, on one or several processes, reproducibly.

Start k of seed s is the same on every machine and with any number of workers: it is drawn
from a generator of its own, and no solve depends on another.
"""

import math
import os
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Generic

import joblib
import numpy as np
from tqdm import tqdm
from typing_extensions import TypeVar

from nlp.arrays import FloatArray, one_blas_thread, whole_number
from nlp.errors import InputError, WorkerError
from nlp.interrupts import deferred_interrupt, interrupt_answered
from nlp.problem import Problem
from nlp.processes import Processes
from nlp.spread import spread
from nlp.task import Chunk, Done, Run, Task, generator, packed, run_start, seed_of

__all__ = ["Run", "Study", "Task", "default_workers", "generator", "multistart"]

CHUNK = 10
T = TypeVar("T", default=Run)


@dataclass(frozen=True, eq=False)
class Study(Generic[T]):
    """The result of each start, in the order of the starts.

    Attributes
    ----------
    results
        One entry per start that ended: its `Run`, or what the judge made of it.
    complete
        Whether all starts that were asked for ended and the user did not interrupt: a Ctrl-C
        after the last start is answered, too.
    """

    results: tuple[T, ...]
    complete: bool

    def all_results(self) -> tuple[T, ...]:
        """Return the results; KeyboardInterrupt if the user interrupted the study."""
        if not self.complete:
            raise KeyboardInterrupt
        return self.results


def _unjudged(run: Run) -> Any:
    return run


def default_workers() -> int:
    """Return the number of processor cores that this process may use."""
    return int(joblib.cpu_count())


def multistart(
    build: Callable[[], Problem],
    sample: Callable[[np.random.Generator], FloatArray],
    *,
    starts: int,
    rng: int | np.integer[Any] | np.random.Generator = 0,
    workers: int = 1,
    options: Mapping[str, object] | None = None,
    solver: str = "ipopt",
    compiled: bool = False,
    label: str | None = None,
    judge: Callable[[Run], T] | None = None,
    figure: Callable[[T], float] | None = None,
    allow_files: bool = False,
    time_limit: float | None = None,
) -> Study[T]:
    """Solve one problem from many random starts.

    Parameters
    ----------
    build, sample, options, judge
        See `Task`. With more than one worker they are sent to other processes, also from a
        script or notebook. Without a judge, the results are the runs themselves.
    starts
        How many starts, at least 1.
    rng
        Seed of the study, a whole number of at least 0; or a generator, from which one seed
        is drawn.
    workers
        How many processes at most, at least 1; one runs in this process, and no more are
        started than there is work for.
    solver, compiled, allow_files
        See `nlp.solver.Solver`; the options are that solver's.
    label
        Shown before a progress bar on a terminal's standard error; no bar without it.
    figure
        Of a result, the number whose best the bar shows, NaN for none; by default the
        objective where the solver says that it succeeded.
    time_limit
        Seconds that Ipopt may run from a start, above 0; the start then ends with the status
        ``Maximum_WallTime_Exceeded``. No limit by default.

    Returns
    -------
    Study
        All results, or those there so far if the user interrupted with Ctrl-C.

    Raises
    ------
    InputError
        If a number is out of range, an option is not the solver's, or the task cannot be sent
        to other processes.
    WorkerError
        If a start ends its worker process, each time it is run.
    Exception
        Whatever `build`, `sample` or `judge` raises.
    """
    starts = whole_number("starts", starts, 1)
    seed = seed_of(rng)
    workers = whole_number("workers", workers, 1)
    settings = _limited(options or {}, solver, time_limit)
    task: Task[T] = Task(
        build, sample, settings, judge or _unjudged, solver, compiled, allow_files
    )
    if workers == 1:
        batches = _in_turn(task, seed, starts)
    else:
        batches = _spread(task, seed, starts, workers)
    done: list[Done[T]] = []
    bar = tqdm(
        total=starts,
        desc=label,
        disable=label is None or not os.isatty(2),
        leave=False,
        dynamic_ncols=True,
    )
    with closing(batches), bar:
        best, interrupted = math.nan, False
        try:
            for batch in batches:
                done += batch
                for one in batch:
                    pick = np.fmin if one.sense == "minimise" else np.fmax  # over NaN, too
                    best = float(pick(best, figure(one.result) if figure else one.objective))
                if not math.isnan(best):
                    bar.set_postfix_str(f"best {best:.8g}", refresh=False)
                bar.update(len(batch))
        except KeyboardInterrupt:
            interrupt_answered()
            interrupted = True  # what is done is kept
    done.sort(key=lambda one: one.index)
    return Study(
        tuple(one.result for one in done), complete=len(done) == starts and not interrupted
    )


def _limited(
    options: Mapping[str, object], solver: str, time_limit: float | None
) -> Mapping[str, object]:
    if time_limit is None:
        return options
    allowed = "left out, or seconds above 0 with Ipopt and without its option max_wall_time"
    number = isinstance(time_limit, int | float) and not isinstance(time_limit, bool)
    if not number or not 0 < time_limit < math.inf:
        raise InputError("time limit", time_limit, allowed)
    if solver != "ipopt" or "max_wall_time" in options:
        raise InputError("time limit", f"{time_limit:g} s", allowed)
    return {**options, "max_wall_time": float(time_limit)}


def _in_turn(task: Task[T], seed: int, starts: int) -> Generator[list[Done[T]], None, None]:
    with deferred_interrupt(limited=True):
        solver = task.solver()
    with one_blas_thread():
        for index in range(starts):
            with deferred_interrupt(limited=True):  # not only Ipopt: also conversions of CasADi
                done = run_start(solver, task, seed, index)
            yield [done]


def _spread(
    task: Task[T], seed: int, starts: int, workers: int
) -> Generator[list[Done[T]], None, None]:
    payload = packed(task)
    size = min(CHUNK, -(-starts // workers))
    chunks = (Chunk(payload, seed, range(starts)[k : k + size]) for k in range(0, starts, size))
    with closing(spread(chunks, Processes(workers))) as arrivals:
        for arrival in arrivals:
            for lost in arrival.lost:
                raise lost.error or WorkerError(f"Start {lost.index} {lost.why}.")
            yield arrival.results
