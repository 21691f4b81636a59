"""All configurations of a path's samples, and what failures leave there, by one sweep.

An arm with one joint more than its task has rows holds a pose along curves of configurations,
its self-motion. Points at equal distances on all curves found, sample after sample, are a map
of everything that the arm can do along the path. If joint f locks at θ, the next sample is
reached where its curves pass q_f = θ, next to where the arm is. One sweep from the end of the
path tells for every point which failures the path survives, without any inverse kinematics. It
is an estimate, between points; `survival` tests those that matter.

Positions of a joint that turns twice or more are counted once, without whole turns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.inverse import solve_ik
from formulations.kinematics.link_chain import BoolArray, IntArray
from formulations.paths.survival import JUMP
from formulations.paths.waypoints import Poses
from nlp.arrays import FloatArray

# Distance of points on a curve, and points in each direction, at most.
_STEP, _STEPS = 0.07, 600
# Random starts at each sample, and curves that are followed at once there.
_STARTS, _AT_ONCE = 60, 5
# How often curves start from those of the samples beside, at most.
_ROUNDS = 12
# Points at a sample, about, at most.
_MOST = 1500
# A start this near a point of a curve is on it; a correction this large has lost the curve.
_ON_CURVE, _LOST = 1.5 * _STEP, 0.5 * _STEP


def near_pairs(
    q: FloatArray, other: FloatArray, most: FloatArray, turns: BoolArray
) -> tuple[IntArray, IntArray]:
    """Return the pairs of configurations (n, B) whose joints are at most (n,) apart.

    Whole turns do not count for those of ``turns``, shape (n, 1).
    """
    scale = np.maximum(most, 1e-9)[:, None]
    trees = (_tree(side, turns, scale) for side in (q, other))
    pairs = next(trees).sparse_distance_matrix(
        next(trees), 1.0, p=np.inf, output_type="coo_matrix"
    )
    return pairs.row.astype(int), pairs.col.astype(int)


def _tree(q: FloatArray, turns: BoolArray, scale: FloatArray | float = 1.0) -> cKDTree:
    """Return a tree of configurations (n, B), in which joints that turn are circles."""
    circle = np.where(turns, 2 * np.pi / scale, 0.0)[:, 0]
    inside = np.where(turns, np.mod(q, 2 * np.pi), q) / scale
    # A rounding error must not put a point beside its circle.
    most = np.where(turns, np.nextafter(circle, 0)[:, None], np.inf)
    return cKDTree(np.minimum(inside, most).T, boxsize=circle)


@dataclass(frozen=True, eq=False)
class SelfMotionMap:
    """Points on the self-motion curves of the samples of a path.

    Attributes
    ----------
    points
        Configurations of each sample, shape (n, B), curve after curve.
    joined
        Whether each point is followed on its curve by the next one, shape (B,).
    kinematics
        The arm.
    """

    points: tuple[FloatArray, ...]
    joined: tuple[BoolArray, ...]
    kinematics: Kinematics

    def ends(self) -> tuple[IntArray, ...]:
        """Estimate the last sample reached after joint f locks at each point, (n, B) each."""
        final = len(self.points) - 1
        ends = [np.full(self.points[-1].shape, final)]
        for k in reversed(range(final)):
            here, there = self.points[k], self.points[k + 1]
            last, later = np.full(here.shape, k), ends[-1]
            # Points here, and beginnings of arcs there that may pass near them.
            most, turns = np.full(len(here), JUMP + _ON_CURVE), self.kinematics.turns
            point, first = near_pairs(here, there, most, turns)
            whole = self.joined[k + 1][first]
            point, first = point[whole], first[whole]
            off = self.kinematics.turned(here[:, point] - there[:, first])
            arcs = self.kinematics.turned(there[:, first + 1] - there[:, first])
            for f, width in enumerate(arcs):
                share = np.full(len(width), -1.0)
                np.divide(off[f], width, out=share, where=width != 0)
                met = (share >= 0) & (share <= 1)
                at, arc, share = point[met], first[met], share[met]
                gap = np.max(np.abs(share * arcs[:, met] - off[:, met]), axis=0)
                # The nearest passage of each point.
                order = np.lexsort((gap, at))
                order = order[np.unique(at[order], return_index=True)[1]]
                order = order[gap[order] < JUMP]
                last[f, at[order]] = later[f, arc[order] + (share[order] > 0.5)]
            ends.append(last)
        return tuple(ends[::-1])


def self_motion_map(
    kinematics: Kinematics, poses: Poses, rng: np.random.Generator
) -> SelfMotionMap:
    """Follow the self-motion curves of all samples of a path.

    Starts are random; then curves of each sample start from those of the samples beside it, as
    long as some were missed.

    Parameters
    ----------
    kinematics
        An arm with one joint more than there are rows.
    poses
        The samples.
    rng
        Of the random starts.
    """
    least, largest = kinematics.ranges
    samples = np.repeat(np.arange(len(poses)), _STARTS)
    drawn = rng.uniform(least, largest, (len(least), len(samples)))
    q, reached = solve_ik(kinematics, drawn, *poses.at(samples), iterations=60)
    curves = _Curves(kinematics, poses)
    curves.add(samples[reached], q[:, reached])
    count = len(poses)
    for _ in range(_ROUNDS):
        points = [curves.points(k)[:, ::3] for k in range(count)]
        sides = [
            (points[k + side], k)
            for side in (-1, 1)
            for k in range(count)
            if 0 <= k + side < count
        ]
        before = np.concatenate([q for q, _ in sides], axis=1)
        samples = np.repeat([k for _, k in sides], [q.shape[1] for q, _ in sides])
        q, reached = solve_ik(kinematics, before, *poses.at(samples))
        if not curves.add(samples[reached], q[:, reached]):
            break
    points = [curves.points(k) for k in range(count)]
    joined = [
        np.concatenate([[*np.ones(len(c.T) - 1, bool), False] for c in some] or [[]]).astype(
            bool
        )
        for some in curves.found
    ]
    return SelfMotionMap(tuple(points), tuple(joined), kinematics)


class _Curves:
    """The curves of each sample so far."""

    def __init__(self, kinematics: Kinematics, poses: Poses) -> None:
        self._kinematics, self._poses = kinematics, poses
        self.found: list[list[FloatArray]] = [[] for _ in range(len(poses))]

    def points(self, sample: int) -> FloatArray:
        """Return all points at a sample, of their turns those nearest the middle, (n, B)."""
        none = np.zeros((self._kinematics.size, 0))
        return self._nearest(np.concatenate([none, *self.found[sample]], axis=1))

    def _nearest(self, q: FloatArray) -> FloatArray:
        middle = self._kinematics.middle
        return middle + self._kinematics.turned(q - middle)

    def add(self, samples: IntArray, q: FloatArray) -> int:
        """Follow the curves through starts (n, B) that are on none so far; say how many."""
        order = np.argsort(samples, kind="stable")
        samples, q, added = samples[order], q[:, order], 0
        while True:
            fresh = self._fresh(samples, q)
            samples, q = samples[fresh], q[:, fresh]
            if not len(samples):
                return added
            first = np.searchsorted(samples, samples)
            chosen = np.arange(len(samples)) - first < _AT_ONCE
            batch = samples[chosen], q[:, chosen]
            for sample, start, curve in zip(
                batch[0], batch[1].T, self._followed(*batch), strict=True
            ):
                # Others of this batch may be on the same curve.
                if self._fresh(np.array([sample]), start[:, None])[0]:
                    self.found[sample].append(curve)
                    added += 1
            samples, q = samples[~chosen], q[:, ~chosen]

    def _fresh(self, samples: IntArray, q: FloatArray) -> BoolArray:
        """Whether configurations are on no curve, shape (B,); none is once there are enough."""
        fresh = np.zeros(len(samples), dtype=bool)
        for sample in np.unique(samples).tolist():
            here, points = samples == sample, self.points(sample)
            if points.shape[1] < _MOST:
                tree, asked = (_tree(x, self._kinematics.turns) for x in (points, q[:, here]))
                fresh[here] = tree.query(asked.data)[0] >= _ON_CURVE
        return fresh

    def _followed(self, samples: IntArray, start: FloatArray) -> list[FloatArray]:
        """Follow curves both ways, to where they close, or end at a limit."""
        matrix = self._kinematics.forward(start)[2]
        tangent = np.linalg.svd(np.moveaxis(matrix, -1, 0))[2][:, -1].T
        halves = []
        closed = np.zeros(len(samples), dtype=bool)
        for sign in (1, -1):
            half, closes = self._half(samples, start, sign * tangent, ~closed)
            halves.append(half)
            closed |= closes
        curves = []
        for k in range(len(samples)):
            forwards, backwards = (half[:, :, k] for half in halves)
            line = np.concatenate([backwards[::-1], start[None, :, k], forwards])
            curves.append(line[np.isfinite(line[:, 0])].T)
        return curves

    def _half(
        self, samples: IntArray, start: FloatArray, tangent: FloatArray, wanted: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Follow curves one way; points (steps, n, B), NaN beyond the end, and which closed."""
        kinematics, size = self._kinematics, len(start)
        closed = np.zeros(len(samples), dtype=bool)
        active = np.flatnonzero(wanted)
        here, tangent = start[:, active], tangent[:, active]
        points, beyond = [], []
        for step in range(_STEPS):
            if not active.size:
                break
            q = here + _STEP * tangent
            origin, orientation, matrix = kinematics.forward(q)
            missing = kinematics.error(origin, orientation, *self._poses.at(samples[active]))
            square = np.concatenate([matrix, tangent[None]])
            sides = np.zeros((len(active), size, 2))
            sides[:, :-1, 0], sides[:, -1, 1] = missing.T, 1.0
            square = np.moveaxis(square, -1, 0) + 1e-12 * np.eye(size)
            moves = np.linalg.solve(square, sides)
            q = q + moves[:, :, 0].T
            on_curve = np.linalg.norm(moves[:, :, 0], axis=1) < _LOST
            within = (q >= kinematics.lower) & (q <= kinematics.upper)
            inside = np.all(within | kinematics.turns, axis=0)
            line = np.full(start.shape, np.nan)
            points.append(line)
            over = on_curve & ~inside
            steps = np.full(int(over.sum()), step)
            beyond.append((active[over], steps, here[:, over], q[:, over]))
            going = on_curve & inside
            active, here = active[going], q[:, going]
            tangent = moves[going, :, 1].T
            tangent = tangent / np.linalg.norm(tangent, axis=0)
            line[:, active] = here
            if step > 1:
                # The start again, perhaps some turns away, closes the curve.
                off = kinematics.turned(here - start[:, active])
                near = np.linalg.norm(off, axis=0) < 0.8 * _STEP
                line[:, active[near]] = (here - off)[:, near]
                closed[active[near]] = True
                active, here, tangent = active[~near], here[:, ~near], tangent[:, ~near]
        lines = np.array(points).reshape(-1, *start.shape)
        if beyond:  # the last points, at limits
            parts = zip(*beyond, strict=True)
            which, steps, before, q = (np.concatenate(part, axis=-1) for part in parts)
            q = np.clip(self._nearest(q), kinematics.lower, kinematics.upper)
            q, reached = solve_ik(kinematics, q, *self._poses.at(samples[which]))
            reached &= np.linalg.norm(kinematics.turned(q - before), axis=0) < _ON_CURVE
            lines[steps[reached], :, which[reached]] = q[:, reached].T
        return lines, closed
