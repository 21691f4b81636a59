"""Configurations at the samples of a path, and the best sequence of one at each.

Each configuration is a node. Its score is the number of joints that may lock there, by the test
in `survival`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.link_chain import BoolArray, IntArray
from formulations.paths.self_motion_map import near_pairs
from formulations.paths.survival import JUMP, survivors
from formulations.paths.waypoints import Poses, place_name
from nlp.arrays import FloatArray
from nlp.errors import InputError

# What one squared radian of motion between two samples costs, in joints that survive.
_MOTION = 2.0
# Speeds stay below this share of their limits until the polish.
_SPEED = 0.98
# Of nodes with an estimate: how near the best sequence they are tested, and how many of the
# best of each sample are.
_BESIDE, _CHOSEN = 0.15, 4
_ONE_TRAJECTORY = "a path that one trajectory follows within the joints' limits"


class Nodes:
    """The nodes at each sample, with what is left of the path after each joint's failure.

    Parameters
    ----------
    kinematics
        The arm.
    poses
        The samples of the path.
    seed
        Of the test in `survival`.
    """

    def __init__(self, kinematics: Kinematics, poses: Poses, seed: int) -> None:
        self._kinematics, self._poses, self._seed = kinematics, poses, seed
        #: Whether the self-motion of a sample is made of curves, see `self_motion_map`.
        self.mapped = kinematics.size == len(kinematics.rows) + 1
        self._turns = kinematics.turns & self.mapped
        self._q = np.zeros((kinematics.size, 0))
        # Of each node: its sample, and the last sample that is reached after each failure.
        self._samples = np.zeros(0, dtype=int)
        self._ends = np.zeros((kinematics.size, 0), dtype=int)
        # The others are estimates.
        self._tested = np.zeros(0, dtype=bool)

    @property
    def count(self) -> int:
        """How many nodes were tested, at all samples together."""
        return int(np.sum(self._tested))

    def at(self, sample: int) -> FloatArray:
        """Return the nodes at a sample, shape (n, B)."""
        return self._q[:, self._samples == sample]

    def survives(self, sample: int) -> BoolArray:
        """Whether a test finished the path after joint f locked at each node, shape (n, B)."""
        return (self._finished & self._tested)[:, self._samples == sample]

    @property
    def _finished(self) -> BoolArray:
        """As tested or estimated, shape (n, B)."""
        return np.asarray(self._ends == len(self._poses) - 1)

    def add(
        self, samples: IntArray, nodes: FloatArray, estimated: IntArray | None = None
    ) -> None:
        """Add configurations, shape (n, B), each at its sample, (B,), and test them.

        They are not tested if what a test would give is estimated, (n, B); see `survivors`.
        """
        if not len(samples):
            return
        before = len(self._samples)
        unknown = np.zeros(nodes.shape, dtype=int)
        ends = unknown if estimated is None else estimated
        self._q = np.concatenate([self._q, nodes], axis=1)
        self._samples = np.concatenate([self._samples, samples])
        self._ends = np.concatenate([self._ends, ends], axis=1)
        self._tested = np.append(self._tested, np.zeros(len(samples), dtype=bool))
        if estimated is None:
            self._test(np.arange(before, len(self._samples)))

    def _test(self, nodes: IntArray) -> None:
        """Test those of some nodes that were not."""
        nodes = nodes[~self._tested[nodes]]
        if len(nodes):
            given = self._q[:, nodes], self._samples[nodes], self._poses
            self._ends[:, nodes] = survivors(self._kinematics, *given, seed=self._seed)
            self._tested[nodes] = True

    def test_best(self) -> None:
        """Test nodes that have, by the estimate, most survivors, and some for each joint."""
        finished, chosen = self._finished, []
        for sample in range(len(self._poses)):
            here = np.flatnonzero(self._samples == sample)
            own = finished[:, here]
            total = own.sum(axis=0)
            for row in (total == total.max(), *own):
                where = here[row]
                # Neighbours on a curve are alike, and its ends less sure.
                spread = (np.arange(_CHOSEN) + 0.5) / _CHOSEN * len(where)
                chosen.append(where[spread.astype(int)] if len(where) else where)
        self._test(np.unique(np.concatenate(chosen)))

    def add_tracks(self, tracks: FloatArray) -> None:
        """Add tracks, shape (N, n, B), NaN where they have no configuration."""
        samples, which = np.nonzero(np.isfinite(tracks[:, 0]))
        self.add(samples, tracks[samples, :, which].T)

    def best_sequence(
        self, most: FloatArray, names: Sequence[str], places: FloatArray
    ) -> FloatArray:
        """Return the sequence of largest total score and little motion, shape (N, n).

        By dynamic programming from sample to sample. If nodes were not tested, those of the
        sequence and beside it are, until all of the best sequence are.

        Parameters
        ----------
        most
            Largest motion of each joint between two samples, shape (N - 1, n).
        names, places
            Of the joints, and where the samples are: for the sentence of an error.

        Raises
        ------
        InputError
            If no sequence keeps to the largest motions.
        """
        while True:
            best = self._best_nodes(most, names, places)
            if self._tested[best].all():
                return self._turned_on(self._q[:, best], names)
            at = self._q[:, best][:, self._samples]
            off = np.abs(self.apart(self._q, at))
            self._test(np.flatnonzero(np.max(off, axis=0) < _BESIDE))

    def apart(self, q: FloatArray, other: FloatArray) -> FloatArray:
        """Return q - other, both (n, B), without whole turns where those do not count."""
        return self._kinematics.turned(q - other) if self.mapped else q - other

    def _turned_on(self, q: FloatArray, names: Sequence[str]) -> FloatArray:
        """Add the turns that make a sequence (n, N) continuous; return it as (N, n)."""
        lower, upper = self._kinematics.lower, self._kinematics.upper
        steps = self.apart(q[:, 1:], q[:, :-1])
        whole = np.cumsum(np.concatenate([q[:, :1], steps], axis=1), axis=1)
        centre = (whole.min(axis=1) + whole.max(axis=1))[:, None] / 2 - self._kinematics.middle
        whole -= centre - np.where(self._turns, self._kinematics.turned(centre), centre)
        outside = np.any((whole < lower - 1e-9) | (whole > upper + 1e-9), axis=1)
        if outside.any():
            name = names[int(np.argmax(outside))]
            raise InputError("path", f"turns {name} beyond its limits", _ONE_TRAJECTORY)
        return np.asarray(np.clip(whole, lower, upper).T)

    def _best_nodes(
        self, most: FloatArray, names: Sequence[str], places: FloatArray
    ) -> IntArray:
        """Return the nodes of the best sequence as it is known now, shape (N,)."""
        which = [np.flatnonzero(self._samples == k) for k in range(len(self._poses))]
        nodes = [self._q[:, here] for here in which]
        scores = [np.sum(self._finished[:, here], axis=0) for here in which]
        value = scores[0].astype(float)
        origins = []
        for k, (now, later) in enumerate(pairwise(nodes)):
            source, target, cost = self._moves(now, later, most[k])
            total = value[source] - cost
            order = np.lexsort((-source, total, target))  # the best of each target comes last
            source, target, total = source[order], target[order], total[order]
            final = np.append(np.diff(target) > 0, True)[: len(target)]
            origin = np.zeros(later.shape[1], dtype=int)
            value = np.full(later.shape[1], -np.inf)
            origin[target[final]], value[target[final]] = source[final], total[final]
            origins.append(origin)
            value = value + scores[k + 1]
            if not np.any(np.isfinite(value)):
                raise self._gap(now, later, most[k], names, place_name(float(places[k + 1])))
        at = int(np.argmax(value))
        sequence = [which[-1][at]]
        for origin, before in zip(reversed(origins), reversed(which[:-1]), strict=True):
            at = int(origin[at])
            sequence.append(before[at])
        return np.array(sequence[::-1])

    def _moves(
        self, now: FloatArray, later: FloatArray, most: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the motions that are not too fast: from which node to which, at what cost."""
        limits = np.minimum(_SPEED * most, JUMP)
        source, target = near_pairs(now, later, limits, self._turns)
        motion = np.sum(self.apart(later[:, target], now[:, source]) ** 2, axis=0)
        return source, target, _MOTION * motion

    def _gap(
        self,
        now: FloatArray,
        later: FloatArray,
        most: FloatArray,
        names: Sequence[str],
        where: str,
    ) -> InputError:
        """Say why no sequence passes: the limits of speed, or of position."""
        off = [np.abs(self.apart(later, point[:, None])) / most[:, None] for point in now.T]
        nearest = min((ratio[:, np.argmin(np.max(ratio, axis=0))] for ratio in off), key=np.max)
        least = float(np.max(nearest))
        if least > _SPEED:
            name = names[int(np.argmax(nearest))]
            more = f"at least {1.1 * least:.2g} times as much time there"
            return InputError(f"speed of {name} at {where}", f"{least:.3g} of its limit", more)
        return InputError(where, "reached from no configuration before it", _ONE_TRAJECTORY)
