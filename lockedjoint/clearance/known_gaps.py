"""Distances of links at configurations that are looked at more than once.

A way begins where the one before it ended, and ways between the same configurations are tried
again. So what is known of a configuration is kept for some time.

Letters: n joints, B configurations as columns, shape (n, B), radians or (prismatic joints)
metres; P pairs of links. Distances are metres, shape (P, B).
"""

from __future__ import annotations

import numpy as np

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray

# Number of distances, of all pairs and configurations, that are kept. With more, fewer are
# computed again, and more memory is taken: 17 bytes each.
_KEPT = 500_000


class KnownGaps:
    """Distances of the pairs of a `LinkClearance`, of which the latest are kept.

    One thread at a time may ask for them.
    """

    def __init__(self, clearance: LinkClearance) -> None:
        self.clearance = clearance
        self._forget(0)

    def __reduce__(self) -> tuple[type[KnownGaps], tuple[LinkClearance]]:
        """Travel to other processes without what is known."""
        return KnownGaps, (self.clearance,)

    def _forget(self, needed: int) -> None:
        """Forget all, and make room for so many configurations at least."""
        pairs = len(self.clearance.pairs)
        shape = pairs, max(needed, _KEPT // pairs)
        # Places of configurations in the arrays, by the bytes of their positions; distances of
        # capsules; those of the geometry, and where these are known.
        self._places: dict[bytes, int] = {}
        self._capsules, self._exact = np.empty(shape), np.empty(shape)
        self._measured = np.zeros(shape, dtype=bool)

    def capsules(self, q: FloatArray) -> FloatArray:
        """Return `LinkClearance.distances` at configurations (n, B)."""
        at = self._at(q)  # this may make new arrays
        return np.asarray(self._capsules[:, at])

    def exact(self, q: FloatArray, wanted: BoolArray) -> FloatArray:
        """Return the same, but `LinkClearance.gaps` where it is wanted, (P, B)."""
        at = self._at(q)
        known = self._capsules[:, at]
        unknown = wanted & ~self._measured[:, at]
        if unknown.any():
            pairs, columns = np.nonzero(unknown)
            found = self.clearance.gaps(q, unknown, known)[pairs, columns]
            self._exact[pairs, at[columns]] = found
            self._measured[pairs, at[columns]] = True
        return np.where(wanted, self._exact[:, at], known)

    def _at(self, q: FloatArray) -> IntArray:
        """Return the places of configurations (n, B) in the arrays, shape (B,)."""
        keys = [point.tobytes() for point in np.ascontiguousarray(q.T)]
        new = [k for k, key in enumerate(keys) if key not in self._places]
        if len(self._places) + len(new) > self._measured.shape[1]:
            self._forget(len(keys))
            new = list(range(len(keys)))
        if new:
            distances = self.clearance.distances(q[:, new])
            for k in new:
                self._places.setdefault(keys[k], len(self._places))
            places = [self._places[keys[k]] for k in new]
            self._capsules[:, places] = distances
        return np.array([self._places[key] for key in keys], dtype=int)
