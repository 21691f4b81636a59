"""When an entry has enough random starts: a rule on the different values that they ended at."""

from collections.abc import Sequence

import numpy as np

from lockedjoint.formulations.solving.outcome import REACHED_BEST

#: Number of starts that must reach the best before the rule can hold.
OFTEN = 5


def settled(starts: int, optima: int, reached: int) -> bool:
    """Whether enough starts were made: Boender and Rinnooy Kan's rule, and `OFTEN` at the best.

    With w optima seen in N starts the expected number of optima is w(N − 1)/(N − w − 2); the
    rule holds when that is below w + ½.
    """
    return reached >= OFTEN and starts >= least_starts(optima)


def least_starts(optima: int) -> int:
    """Return the least N for which the rule holds with w optima: 2w² + 3w + 3."""
    return 2 * optima**2 + 3 * optima + 3


def unseen_share(starts: int, optima: int) -> float:
    """Return the expected share of starts that end at an optimum not yet seen.

    With w optima seen in N starts it is w(w + 1)/(N(N − 1)), under the same prior; it is 1
    where nothing is known, as where every start ended at another optimum.
    """
    if starts < 2 or optima == 0:
        return 1.0
    return min(1.0, optima * (optima + 1) / (starts * (starts - 1)))


def different(scores: Sequence[float]) -> int:
    """Return the number of different scores, to `REACHED_BEST`."""
    ordered = np.sort(scores)
    return int(np.sum(np.diff(ordered) > REACHED_BEST)) + bool(scores)
