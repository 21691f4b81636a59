"""One problem from many starts, in this process or on any executor, reproducibly.

Start k of a seed is reproducible across machines and numbers of workers: it is drawn from a
generator of its own, and no solve depends on another.
"""

import math
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import reduce
from typing import Any, Generic

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeVar

from lockedjoint.nlp.arrays import FloatArray, Rng, as_floats, one_blas_thread, whole_number
from lockedjoint.nlp.errors import InputError, WorkerError, a_function, of_kind
from lockedjoint.nlp.executors import LocalExecutor, dispatch
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.progress import tqdm_class
from lockedjoint.nlp.starts import Chunk, Run, Task, packed, seed_of

#: Largest number of starts that a worker is given at once: more cost less to send, and keep the
#: last worker longer at work alone.
CHUNK = 10
T = TypeVar("T", default=Run)


@dataclass(frozen=True, eq=False)
class MultistartResult(Generic[T]):
    """The result of each start, in the order of the starts.

    Attributes
    ----------
    results
        One per start that ended: its `Run`, or what the judge made of it.
    complete
        Whether all starts that were asked for ended and the user did not interrupt: a Ctrl-C
        after the last start is answered, too.
    """

    results: tuple[T, ...]
    complete: bool


def multistart(
    build: Callable[[], Problem],
    sample: Callable[[np.random.Generator], FloatArray] | npt.ArrayLike,
    *,
    starts: int | None = None,
    first: int = 0,
    seed: Rng | None = None,
    rng: Rng | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    options: Mapping[str, object] | None = None,
    solver: str = "ipopt",
    label: str | None = None,
    judge: Callable[[Run], T] | None = None,
    figure: Callable[[T], float] | None = None,
    better: Callable[[float, float], float] = np.fmin,
) -> MultistartResult[T]:
    """Solve one problem from many starts.

    Parameters
    ----------
    build, options, judge
        See `Task`. With an executor they are sent to other processes, also from a script or
        notebook. Without a judge, the results are the runs themselves.
    sample
        Draws a start from a generator; or the starts themselves, shape (starts, variables).
    starts
        How many starts, at least 1; left out where `sample` holds them.
    first
        Number of the first of them.
    seed, rng
        Random seed, 0 by default; or a generator, from which one seed is drawn. Two names for
        the same.
    workers
        How many processes at most, at least 1; no more are started than there is work for.
        One is this process, for debugging.
    executor
        Any executor of processes, instead: Dask's ``client.get_executor(pure=False)``, that
        of ``mpi4py.futures``, or another. It is not shut down.
    solver
        See `lockedjoint.nlp.solver.Solver`; the options are that solver's.
    label
        Shown before a progress bar on a terminal or in a notebook; no bar without it.
    figure, better
        Of a result, a number, NaN for none; of two, the better one. The bar shows the best.

    Returns
    -------
    MultistartResult
        All results, or those there so far if the user interrupted with Ctrl-C.

    Raises
    ------
    InputError
        If a number is out of range, an option is not the solver's, or the task cannot be sent
        to other processes.
    WorkerError
        If a start ends its worker process each time it is run.
    Exception
        Whatever `build`, `sample` or `judge` raises.

    Examples
    --------
    >>> import casadi as ca
    >>> import lockedjoint as lj
    >>> def build():
    ...     x = ca.SX.sym("x", 2)
    ...     return lj.Problem("bowl", x, ca.sumsqr(x - 1))
    >>> found = lj.multistart(build, lambda rng: rng.normal(size=2), starts=3)
    >>> len(found.results)
    3
    """
    a_function("build", build)
    for name, given in (("judge", judge), ("figure", figure)):
        if given is not None:
            a_function(name, given)
    if not callable(sample):
        sample = as_floats("sample", sample)
        starts = len(sample) if starts is None and sample.ndim == 2 else starts
        if sample.ndim != 2 or len(sample) != starts:
            shown = f"an array of shape {sample.shape}"
            raise InputError("sample", shown, "a function, or one row for each start")
    count = whole_number("starts", starts, 1)
    number = seed_of(seed, rng)
    first, workers = whole_number("first", first, 0), whole_number("workers", workers, 1)
    of_kind("executor", executor, (Executor, type(None)), "a concurrent.futures.Executor")
    judged: Callable[[Run], Any] = (lambda run: run) if judge is None else judge
    task: Task[T] = Task(build, sample, options or {}, judged, solver, first)
    indices = range(first, first + count)
    if workers == 1 and executor is None:
        batches = _in_this_process(task, number, indices)
    else:
        batches = _dispatched(task, number, indices, workers, executor)
    finished: dict[int, T] = {}
    hidden = True if label is None else None  # None: hidden unless on a terminal
    how = {"disable": hidden, "leave": False, "dynamic_ncols": True}
    bar = tqdm_class()(total=count, desc=label, **how)
    best, interrupted = math.nan, False
    with closing(batches), bar:
        try:
            for batch in batches:
                finished.update(batch)
                if figure is not None:
                    best = reduce(better, map(figure, batch.values()), best)
                if not math.isnan(best):
                    bar.set_postfix_str(f"best {best:.8g}", refresh=False)
                bar.update(len(batch))
        except KeyboardInterrupt:
            interrupted = True  # what is done is kept
    results = tuple(finished[index] for index in sorted(finished))
    return MultistartResult(results, complete=len(results) == count and not interrupted)


def _in_this_process(
    task: Task[T], seed: int, indices: range
) -> Generator[Mapping[int, T], None, None]:
    """Yield the result of each start, by its number, one at a time."""
    solver = task.solver()
    with one_blas_thread():
        for index in indices:
            yield {index: task.result(solver, seed, index)}


def _dispatched(
    task: Task[T], seed: int, indices: range, workers: int, executor: Executor | None
) -> Generator[Mapping[int, T], None, None]:
    """Yield the results of each chunk of starts, by number, as they come from the executor.

    Without an executor worker processes of this machine are used, at most `workers`.
    """
    payload = packed(task)
    size = min(CHUNK, -(-len(indices) // workers))
    firsts = range(0, len(indices), size)
    chunks = (Chunk(payload, seed, indices[k : k + size]) for k in firsts)
    # Number of chunks that the executor of a caller gets at once; if None, it is asked.
    capacity = workers if executor is not None and workers > 1 else None
    with ExitStack() as opened:
        if executor is None:
            executor = opened.enter_context(LocalExecutor(min(workers, len(firsts))))
        results = opened.enter_context(closing(dispatch(chunks, executor, capacity=capacity)))
        for result in results:
            for failed in result.failed:
                raise failed.error or WorkerError(f"Start {failed.index} {failed.reason}.")
            yield result.finished
