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
from formulations.paths.survival import JUMP, survivors
from formulations.paths.waypoints import Poses, place_name
from nlp.arrays import FloatArray
from nlp.errors import InputError

# What one squared radian of motion between two samples costs, in joints that survive.
_MOTION = 10.0
# Speeds stay below this share of their limits until the polish.
_SPEED = 0.98


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
        self._q = np.zeros((kinematics.size, 0))
        # Of each node: its sample, and the last sample that is reached after each failure.
        self._samples = np.zeros(0, dtype=int)
        self._ends = np.zeros((kinematics.size, 0), dtype=int)

    @property
    def count(self) -> int:
        """How many nodes there are at all samples together."""
        return len(self._samples)

    def at(self, sample: int) -> FloatArray:
        """Return the nodes at a sample, shape (n, B)."""
        return self._q[:, self._samples == sample]

    def survives(self, sample: int) -> BoolArray:
        """Whether the path can be finished after joint f locks at each node, shape (n, B)."""
        return np.asarray(self._ends[:, self._samples == sample] == len(self._poses) - 1)

    def add(self, samples: IntArray, nodes: FloatArray) -> None:
        """Add configurations, shape (n, B), each at its sample, (B,), and test them."""
        if len(samples):
            ends = survivors(self._kinematics, nodes, samples, self._poses, seed=self._seed)
            self._q = np.concatenate([self._q, nodes], axis=1)
            self._samples = np.concatenate([self._samples, samples])
            self._ends = np.concatenate([self._ends, ends], axis=1)

    def add_tracks(self, tracks: FloatArray) -> None:
        """Add tracks, shape (N, n, B), NaN where they have no configuration."""
        samples, which = np.nonzero(np.isfinite(tracks[:, 0]))
        self.add(samples, tracks[samples, :, which].T)

    def best_sequence(
        self, most: FloatArray, names: Sequence[str], places: FloatArray
    ) -> FloatArray:
        """Return the sequence of largest total score and little motion, shape (N, n).

        By dynamic programming from sample to sample.

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
        nodes = [self.at(k) for k in range(len(self._poses))]
        scores = [np.sum(self.survives(k), axis=0) for k in range(len(self._poses))]
        value = scores[0].astype(float)
        origins = []
        for k, (now, later) in enumerate(pairwise(nodes)):
            total = value[:, None] - _cost(now, later, most[k])
            origins.append(np.argmax(total, axis=0))
            value = np.max(total, axis=0) + scores[k + 1]
            if not np.any(np.isfinite(value)):
                raise _gap(now, later, most[k], names, place_name(float(places[k + 1])))
        at = int(np.argmax(value))
        sequence = [nodes[-1][:, at]]
        for origin, before in zip(reversed(origins), reversed(nodes[:-1]), strict=True):
            at = int(origin[at])
            sequence.append(before[:, at])
        return np.array(sequence[::-1])


def _cost(now: FloatArray, later: FloatArray, most: FloatArray) -> FloatArray:
    """Return what motion from each node to each later one costs; infinity if it is too fast."""
    allowed = np.minimum(_SPEED * most, JUMP)
    cost = np.zeros((now.shape[1], later.shape[1]))
    for f in range(len(now)):
        gap = later[f][None] - now[f][:, None]
        cost += np.where(np.abs(gap) <= allowed[f], _MOTION * gap**2, np.inf)
    return cost


def _gap(
    now: FloatArray, later: FloatArray, most: FloatArray, names: Sequence[str], where: str
) -> InputError:
    """Say why no sequence passes: the limits of speed, or of position."""
    ratios = [np.abs(later - point[:, None]) / most[:, None] for point in now.T]
    nearest = min((ratio[:, np.argmin(np.max(ratio, axis=0))] for ratio in ratios), key=np.max)
    least = float(np.max(nearest))
    if least > _SPEED:
        name = names[int(np.argmax(nearest))]
        allowed = f"at least {1.1 * least:.2g} times as much time there"
        return InputError(f"speed of {name} at {where}", f"{least:.3g} of its limit", allowed)
    allowed = "a path that one trajectory follows within the joints' limits"
    return InputError(where, "reached from no configuration before it", allowed)
