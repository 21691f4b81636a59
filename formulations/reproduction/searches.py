"""Many starts for one row; an interrupted search gives no row at all."""

from collections.abc import Callable, Mapping

import numpy as np

from nlp.arrays import FloatArray
from nlp.multistart import multistart
from nlp.problem import Problem, Solution


def search(
    build: Callable[[], Problem],
    sample: Callable[[np.random.Generator], FloatArray],
    starts: int,
    seed: int,
    options: Mapping[str, object] | None = None,
) -> list[Solution]:
    """Solve from random starts in this process, one solution per start; see `multistart`.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted: shares of an unfinished search would be wrong.
    """
    result = multistart(build, sample, starts=starts, seed=seed, options=options)
    if not result.complete:
        raise KeyboardInterrupt
    return [start.solution for start in result.results]


def optima(solutions: list[Solution]) -> list[FloatArray]:
    """Return the Jacobians of the feasible points that the solver converged to."""
    return [
        solution.outputs["jacobian"]
        for solution in solutions
        if solution.status.acceptable and solution.feasible
    ]
