"""Many starts for one row; an interrupted search gives no row at all."""

from collections.abc import Callable, Mapping

import numpy as np

from nlp.arrays import FloatArray
from nlp.multistart import multistart
from nlp.problem import Problem
from nlp.solution import Solution


def search(
    build: Callable[[], Problem],
    sample: Callable[[np.random.Generator], FloatArray],
    starts: int,
    seed: int,
    options: Mapping[str, object] | None = None,
) -> list[Solution]:
    """Solve from random starts in this process, one solution per start.

    Parameters
    ----------
    build, sample, options
        See `nlp.starts.Task`.
    starts, seed
        See `nlp.multistart.multistart`.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted: shares of an unfinished search would be wrong.
    """
    study = multistart(build, sample, starts=starts, seed=seed, options=options)
    if not study.complete:
        raise KeyboardInterrupt
    return [run.solution for run in study.results]


def optima(solutions: list[Solution]) -> list[FloatArray]:
    """Return the Jacobians of the feasible points that the solver converged to."""
    return [
        solution.outputs["jacobian"]
        for solution in solutions
        if solution.status.acceptable and solution.feasible
    ]
