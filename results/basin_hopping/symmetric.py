"""Starts from random Jacobians that a map of finite order carries into themselves."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.nlp.arrays import FloatArray
from results.atlas.search import symmetric_climb


@dataclass(frozen=True, eq=False)
class SymmetricStarts:
    """Starts for an entry that each climb from many symmetric Jacobians, and take the best.

    A climb stays among the Jacobians of its symmetry, which have few variables. With nine
    joints it takes a hundredth of a second, with sixteen a second.

    Attributes
    ----------
    asked
        The entry, one of those with `has_symmetric_starts`.
    draws
        Number of symmetric Jacobians that are drawn for each start. From those with the worst
        case 0 nothing climbs.
    """

    asked: Entry
    draws: int

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the best Jacobian of the climbs of one start, (m, n).

        LinAlgError if there is none.
        """
        jacobians = list(self._climbs(rng))
        if not jacobians:
            raise np.linalg.LinAlgError("no symmetric Jacobian to climb from")
        return max(jacobians, key=self.asked.score)

    def _climbs(self, rng: np.random.Generator) -> Iterator[FloatArray]:
        """Yield the Jacobian at which each climb ends."""
        for _ in range(self.draws):
            with suppress(np.linalg.LinAlgError):
                climb = symmetric_climb(self.asked, rng)
                if climb is not None:
                    yield climb[0]
