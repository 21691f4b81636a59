"""A map of a path that foretells which failures it survives, from self-motion curves.

The map is for arms with one joint more than their task has rows, which hold a pose along curves
of configurations. If joint f locks at θ, the next sample is reached where its curves pass
q_f = θ, next to where the arm is. One sweep from the end of the path tells for every point
which failures the path survives, without any inverse kinematics. It is an estimate, between
points. Positions of a joint that turns twice or more are counted without whole turns.

Configurations have the shape (n, B), n joints in rad or m, and B points.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.following import JUMP
from lockedjoint.paths.near_pairs import configuration_tree, near_pairs
from lockedjoint.paths.self_motion_curves import ON_CURVE_M_OR_RAD, followed, nearest_turn
from lockedjoint.paths.survival import on_path
from lockedjoint.paths.waypoints import Poses

# Number of random starts of inverse kinematics at each sample.
_STARTS_PER_SAMPLE = 180
# Largest number of iterations of inverse kinematics from a random start.
_START_ITERATIONS = 25
# Number of points of a new curve of which one is a start at the samples beside.
_POINTS_PER_START = 3
# Number of curves that are followed at once at a sample.
_CURVES_AT_ONCE = 5
# Largest number of times that curves start from those of the samples beside.
_MOST_ROUNDS = 12
# Number of points of a sample above which it gets no new curves.
_MOST_POINTS = 1500
# Distance in a tree of points between samples: more than configurations are counted as near.
_SAMPLE_DISTANCE_M_OR_RAD = 10.0


class SelfMotionMap:
    """Points at equal distances on the self-motion curves of all samples of a path.

    Curves start from random configurations, and then from the curves of the samples beside, as
    long as some were missed.
    """

    def __init__(self, chain: Chain, poses: Poses, rng: np.random.Generator) -> None:
        self._chain, self._poses, self._rng = chain, poses, rng
        # Each point has a sample and a curve. The points of a curve are in order.
        self._q, self._samples = np.zeros((len(chain.joints), 0)), np.zeros(0, dtype=int)
        self._curves = np.zeros(0, dtype=int)
        count = len(poses)
        samples, q = on_path(
            chain,
            poses,
            np.repeat(np.arange(count), _STARTS_PER_SAMPLE),
            rng,
            _START_ITERATIONS,
        )
        tried = 0
        for _ in range(_MOST_ROUNDS):
            self._add(samples, q)
            # Points of the new curves are starts at the samples before and after.
            new = slice(tried, None, _POINTS_PER_START)
            samples = np.concatenate([self._samples[new] - 1, self._samples[new] + 1])
            inside, tried = (samples >= 0) & (samples < count), len(self._samples)
            samples, q = samples[inside], np.tile(self._q[:, new], 2)[:, inside]
            q, reached = solve_ik(chain, q, poses.at(samples))
            samples, q = samples[reached], q[:, reached]
            if not len(samples):
                break

    def points(self, sample: int) -> FloatArray:
        """Return all points at a sample, of their turns those nearest the middle, (n, B)."""
        return self._q[:, self._samples == sample]

    def ends(self) -> list[IntArray]:
        """Estimate the last sample reached after joint f locks at each point, (n, B) each.

        Joint f of a point at q passes an arc from a to b where the share x of the arc has
        x (b_f − a_f) = q_f − a_f, with 0 ≤ x ≤ 1.
        """
        chain, final = self._chain, len(self._poses) - 1
        there = self.points(final)
        ends = [np.full(there.shape, final)]
        most = np.full(len(chain.joints), JUMP + ON_CURVE_M_OR_RAD)
        for k in reversed(range(final)):
            here, later = self.points(k), ends[-1]
            last = np.full(here.shape, k)
            # Points here are paired with beginnings of arcs there that may pass near them.
            point, first = near_pairs(here, there, most, chain.whole_turns)
            curve = self._curves[self._samples == k + 1]
            goes_on = np.append(curve[1:] == curve[:-1], False)[first]
            point, first = point[goes_on], first[goes_on]
            # Of each pair q − a and b − a, shape (n, pairs).
            off = chain.turned(here[:, point] - there[:, first])
            arcs = chain.turned(there[:, first + 1] - there[:, first])
            for f, width in enumerate(arcs):
                share = np.full(len(width), -1.0)
                np.divide(off[f], width, out=share, where=width != 0)
                met = (share >= 0) & (share <= 1)
                at, arc, share = point[met], first[met], share[met]
                # Distance of the point from the passage, the largest of all joints, (met,).
                gap = np.max(np.abs(share * arcs[:, met] - off[:, met]), axis=0)
                # The nearest passage of each point counts.
                order = np.lexsort((gap, at))
                order = order[np.unique(at[order], return_index=True)[1]]
                order = order[gap[order] < JUMP]
                last[f, at[order]] = later[f, arc[order] + (share[order] > 0.5)]
            ends.append(last)
            there = here
        return ends[::-1]

    def _add(self, samples: IntArray, q: FloatArray) -> None:
        """Follow the curves through starts (n, B) that are on none so far."""
        # The order is random, as starts beside each other are on one curve.
        order = self._rng.permutation(len(samples))
        order = order[np.argsort(samples[order], kind="stable")]
        samples, q, known = samples[order], q[:, order], 0
        while True:
            fresh = self._fresh(samples, q, known)
            samples, q, known = samples[fresh], q[:, fresh], len(self._samples)
            if not len(samples):
                return
            chosen = (
                np.arange(len(samples)) - np.searchsorted(samples, samples) < _CURVES_AT_ONCE
            )
            at, starts = samples[chosen], q[:, chosen]
            owner, points = followed(self._chain, self._poses, at, starts)
            # The first of several starts on one curve counts.
            asked = self._tree(at, starts).data
            near = self._tree(at[owner], points).query_ball_point(asked, ON_CURVE_M_OR_RAD)
            first = np.array([np.min(owner[own]) for own in near])
            kept = (first == np.arange(len(at)))[owner]
            self._q = np.concatenate(
                [self._q, nearest_turn(self._chain, points[:, kept])], axis=1
            )
            self._samples = np.concatenate([self._samples, at[owner[kept]]])
            self._curves = np.concatenate([self._curves, known + owner[kept]])
            samples, q = samples[~chosen], q[:, ~chosen]

    def _fresh(self, samples: IntArray, q: FloatArray, known: int) -> BoolArray:
        """Whether configurations (n, B) are on no curve of the points after the first `known`.

        The result has the shape (B,). It is False at samples that have enough points.
        """
        tree = self._tree(self._samples[known:], self._q[:, known:])
        asked = self._tree(samples, q).data
        away = np.isinf(tree.query(asked, distance_upper_bound=ON_CURVE_M_OR_RAD)[0])
        crowded = np.bincount(self._samples, minlength=len(self._poses)) > _MOST_POINTS
        return np.asarray(away & ~crowded[samples])

    def _tree(self, samples: IntArray, q: FloatArray) -> cKDTree:
        """Return a tree of configurations in which those of other samples are far away."""
        turns = np.append(self._chain.whole_turns, [[False]], axis=0)
        apart = _SAMPLE_DISTANCE_M_OR_RAD * samples[None]
        return configuration_tree(np.concatenate([q, apart]), turns)
