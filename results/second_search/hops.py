"""Moves from one optimum to the next: basin hopping, beside the second search.

A hop moves variables x a little, or draws some joints anew, and climbs again by the last step
of the second search. Where an arm has many poor optima near good ones, a start that goes on by
hops from its own optimum ends at one of few.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.nlp.arrays import FloatArray
from results.second_search.columns import Columns
from results.second_search.smoothed import SmoothedSearch
from results.second_search.tally import Search

# Probability that a hop moves all joints a little; otherwise it draws some of them anew.
_SMALL_MOVE = 0.6
# Range of the decimal logarithm of a small move's standard deviation.
_SMALLEST_MOVE_LOG10 = -2.0
_LARGEST_MOVE_LOG10 = -0.3
# Largest number of joints that a hop draws anew.
_MOST_REDRAWN = 3
# Difference of levels, in logarithms: a hop that is so far below after a polish is given up.
_FAR_BELOW = 1e-3


@dataclass(frozen=True, eq=False)
class BasinHopping:
    """The second search of an entry, whose starts go on by hops.

    Attributes
    ----------
    asked
        The entry.
    smoothed
        Its second search.
    patience
        Number of hops in a row that each gain less than 1e-6, after which a start ends.
    begin
        What leads to the Jacobian from which the hops begin: by default the second search.
    """

    asked: Entry
    smoothed: SmoothedSearch
    patience: int
    begin: Search | None = None

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the Jacobian that one start leads to, (m, n).

        It is none of the entry's if that from which the hops would begin is none.
        """
        best = (self.begin or self.smoothed).answer(rng)
        if not self.asked.holds(best):
            return best
        score, idle = self.asked.score(best), 0
        while idle < self.patience:
            hop = self._hop(best, rng)
            gain = self.asked.score(hop) - score if self.asked.holds(hop) else 0.0
            if gain > 0:
                best, score = hop, score + gain
            idle = 0 if gain > REACHED_BEST else idle + 1
        return best

    def _hop(self, jacobian: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the Jacobian at which a climb from near another one ends, both (m, n).

        It is the other one itself if numbers fail on the way, as where σ is 0.
        """
        columns = self.smoothed.columns
        start = moved(columns.point(jacobian), columns, rng)
        enough = self.smoothed.levels.least(jacobian) - _FAR_BELOW
        try:
            return columns.jacobian(self.smoothed.polished(start, enough))
        except np.linalg.LinAlgError:
            return jacobian


def moved(point: FloatArray, columns: Columns, rng: np.random.Generator) -> FloatArray:
    """Return variables near x, or with some joints drawn anew, shape (size,)."""
    if rng.random() < _SMALL_MOVE:
        size = 10.0 ** rng.uniform(_SMALLEST_MOVE_LOG10, _LARGEST_MOVE_LOG10)
        return np.asarray(point + size * rng.normal(size=point.size))
    changed = point.copy()
    count = rng.integers(1, _MOST_REDRAWN + 1)
    fresh = columns.parts(columns.sample(rng))
    parts = columns.parts(changed)
    for joint in rng.choice(len(parts), count, replace=False):
        parts[joint][:] = fresh[joint]
    return changed
