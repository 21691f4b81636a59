"""Starts from random Jacobians that a map of finite order carries into themselves."""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.nlp.arrays import FloatArray
from results.atlas.search import symmetric_climb


@dataclass(frozen=True, eq=False)
class SymmetricStarts:
    """Starts for an entry that each climb from many symmetric Jacobians, and take the best.

    A climb stays among the Jacobians of its symmetry. These have few variables, so that it
    takes a hundredth of a second.

    Attributes
    ----------
    asked
        The entry, one of those with `has_symmetric_starts`.
    climbs
        Number of climbs for each start.
    """

    asked: Entry
    climbs: int

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the best Jacobian of the climbs of one start, (m, n).

        LinAlgError if all climbs would begin at the worst case 0.
        """
        drawn = (symmetric_climb(self.asked, rng) for _ in range(self.climbs))
        jacobians = [climb[0] for climb in drawn if climb is not None]
        if not jacobians:
            raise np.linalg.LinAlgError("no symmetric Jacobian to climb from")
        return max(jacobians, key=self.asked.score)
