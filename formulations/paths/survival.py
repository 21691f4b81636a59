"""Which joints of a robot may lock along a path: a test, and a map that foretells it.

The test knows nothing of how a trajectory was found. For a joint f and a sample k it locks
joint f at its value there and follows the rest of the path, sample by sample, with the other
joints: damped least squares, within their limits, without a jump from one solution to another.
Where the arm keeps self-motion after the failure, it may first move along that, and starts
again from several of its points. After a failure there is no limit of time: the arm slows
down as it has to.

The map is for arms with one joint more than their task has rows, which hold a pose along curves
of configurations. If joint f locks at θ, the next sample is reached where its curves pass
q_f = θ, next to where the arm is. One sweep from the end of the path tells for every point
which failures the path survives, without any inverse kinematics. It is an estimate, between
points. Positions of a joint that turns twice or more are counted without whole turns.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.inverse import solve_ik
from formulations.kinematics.link_chain import BoolArray, IntArray
from formulations.paths.following import JUMP, Allowed, march
from formulations.paths.waypoints import Poses
from nlp.arrays import FloatArray

# Where the locked arm keeps self-motion: from how many other points of it to try again.
_RESTARTS = 4
# Of the map: distance of points on a curve, and points in each direction, at most.
_STEP, _STEPS = 0.07, 600
# Random starts at each sample, and curves that are followed at once there.
_STARTS, _AT_ONCE = 60, 5
# How often curves start from those of the samples beside, at most.
_ROUNDS = 12
# Points at a sample, about, at most.
_MOST = 1500
# A start this near a point of a curve is on it; a correction this large has lost the curve.
_ON_CURVE, _LOST = 1.5 * _STEP, 0.5 * _STEP


def survivors(
    kinematics: Kinematics,
    nodes: FloatArray,
    samples: IntArray,
    poses: Poses,
    seed: int = 0,
    allowed: Allowed | None = None,
    tracks: FloatArray | None = None,
) -> IntArray:
    """Lock each joint at each of many configurations (n, B) and finish the path.

    Returns the last sample that is reached after joint f locks, shape (n, B). The seed is of
    the points of the self-motion from which it is tried again. What is allowed is which ways
    may be gone. Configurations that finish the path go into the tracks, (n, B, N, n), if
    given: the first is where it was tried from.
    """
    size, count = nodes.shape
    redundant = size - 1 > len(kinematics.rows)
    centre = 0.1 if redundant else 0.0  # towards mid-range, so that limits come later
    locked, which = np.mgrid[:size, :count].reshape(2, -1)
    first: IntArray = samples[which]
    last, rng, pairs = first.copy(), np.random.default_rng(seed), np.arange(len(first))
    for attempt in range(1 + (_RESTARTS if redundant else 0)):
        order = pairs[np.argsort(first[pairs], kind="stable")]
        q, joint, start = nodes[:, which[order]], locked[order], first[order]
        if attempt:
            q = _elsewhere(kinematics, q, joint, start, poses, rng, allowed)
        way = np.full((len(order), 0 if tracks is None else len(poses), size), np.nan)
        if tracks is not None:
            way[np.arange(len(order)), start] = q.T
        given = kinematics, q, poses, start, 1, joint, centre, allowed
        for alive, reached, there in march(*given):
            last[order[alive]] = np.maximum(last[order[alive]], reached)
            if tracks is not None:
                way[alive, reached] = there.T
        if tracks is not None:
            done = ~np.isnan(way[:, -1, 0])
            tracks[joint[done], which[order[done]]] = way[done]
        pairs = np.flatnonzero(last < len(poses) - 1)
        if not pairs.size:
            break
    return np.asarray(last.reshape(size, count))


def on_path(
    kinematics: Kinematics, poses: Poses, sample: int, starts: int, rng: np.random.Generator
) -> FloatArray:
    """Return configurations at a pose, within the limits, from random starts; shape (n, B)."""
    least, largest = kinematics.ranges
    drawn = rng.uniform(least, largest, (len(least), starts))
    q, reached = solve_ik(kinematics, drawn, *poses.at(sample), iterations=60)
    return q[:, reached]


def _elsewhere(
    kinematics: Kinematics,
    q: FloatArray,
    joint: IntArray,
    samples: IntArray,
    poses: Poses,
    rng: np.random.Generator,
    allowed: Allowed | None,
) -> FloatArray:
    """Move along the self-motion that the locked arm keeps, in steps at the same pose."""
    free = np.arange(len(q))[:, None] != joint
    position, rotation = poses.at(samples)
    push = rng.normal(size=q.shape)
    push *= 0.25 / np.sqrt(np.sum(push**2, axis=0))
    for _ in range(int(rng.integers(2, 9))):
        shifted = np.clip(q + push * free, kinematics.lower, kinematics.upper)
        moved, reached = solve_ik(kinematics, shifted, position, rotation, free)
        reached &= np.max(np.abs(moved - q), axis=0) < JUMP
        if allowed is not None:
            reached[reached] = allowed(q[:, reached], moved[:, reached])
        q = np.where(reached, moved, q)
    return q


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


class SelfMotionMap:
    """Points at equal distances on the self-motion curves of all samples of a path.

    Curves start from random configurations, and then from the curves of the samples beside, as
    long as some were missed.
    """

    def __init__(self, kinematics: Kinematics, poses: Poses, rng: np.random.Generator) -> None:
        self._kinematics, self._poses = kinematics, poses
        count, (least, largest) = len(poses), kinematics.ranges
        self._curves: list[list[FloatArray]] = [[] for _ in range(count)]
        samples = np.repeat(np.arange(count), _STARTS)
        q = rng.uniform(least, largest, (len(least), len(samples)))
        q, reached = solve_ik(kinematics, q, *poses.at(samples), iterations=25)
        self._add(samples[reached], q[:, reached])
        beside = [(k + side, k) for side in (-1, 1) for k in range(count)]
        beside = [(other, k) for other, k in beside if 0 <= other < count]
        for _ in range(_ROUNDS):
            points = [self.points(k)[:, ::3] for k in range(count)]
            samples = np.repeat(
                [k for _, k in beside], [points[other].shape[1] for other, _ in beside]
            )
            q = np.concatenate([points[other] for other, _ in beside], axis=1)
            q, reached = solve_ik(kinematics, q, *poses.at(samples))
            if not self._add(samples[reached], q[:, reached]):
                break

    def points(self, sample: int) -> FloatArray:
        """Return all points at a sample, of their turns those nearest the middle, (n, B)."""
        none = np.zeros((self._kinematics.size, 0))
        return self._nearest(np.concatenate([none, *self._curves[sample]], axis=1))

    def ends(self) -> list[IntArray]:
        """Estimate the last sample reached after joint f locks at each point, (n, B) each."""
        kinematics, final = self._kinematics, len(self._poses) - 1
        there = self.points(final)
        ends = [np.full(there.shape, final)]
        most = np.full(kinematics.size, JUMP + _ON_CURVE)
        for k in reversed(range(final)):
            here, later = self.points(k), ends[-1]
            last = np.full(here.shape, k)
            # Points here, and beginnings of arcs there that may pass near them.
            point, first = near_pairs(here, there, most, kinematics.turns)
            final_points = np.cumsum([curve.shape[1] for curve in self._curves[k + 1]]) - 1
            goes_on = ~np.isin(first, final_points)
            point, first = point[goes_on], first[goes_on]
            off = kinematics.turned(here[:, point] - there[:, first])
            arcs = kinematics.turned(there[:, first + 1] - there[:, first])
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
            there = here
        return ends[::-1]

    def _nearest(self, q: FloatArray) -> FloatArray:
        middle = self._kinematics.middle
        return middle + self._kinematics.turned(q - middle)

    def _add(self, samples: IntArray, q: FloatArray) -> int:
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
                    self._curves[sample].append(curve)
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
        kinematics, (size, count) = self._kinematics, start.shape
        lower, upper = kinematics.lower, kinematics.upper
        # Halves: of each curve that along the tangent, and that against it.
        halves = [[point] for point in (*start.T, *start.T)]
        closed = np.zeros(2 * count, dtype=bool)
        matrix = np.moveaxis(kinematics.forward(start)[2], -1, 0)
        tangent = np.linalg.svd(matrix)[2][:, -1].T
        active, own = np.arange(2 * count), np.arange(2 * count) % count
        here, tangent = start[:, own], np.concatenate([tangent, -tangent], axis=1)
        for step in range(_STEPS):
            if not active.size:
                break
            q = here + _STEP * tangent
            origin, orientation, matrix = kinematics.forward(q)
            poses = self._poses.at(samples[own[active]])
            square = np.moveaxis(np.concatenate([matrix, tangent[None]]), -1, 0)
            sides = np.zeros((len(active), size, 2))
            sides[:, :-1, 0] = kinematics.error(origin, orientation, *poses).T
            sides[:, -1, 1] = 1.0
            moves = np.linalg.solve(square + 1e-12 * np.eye(size), sides)
            q = q + moves[:, :, 0].T
            on_curve = np.linalg.norm(moves[:, :, 0], axis=1) < _LOST
            inside = np.all((q >= lower) & (q <= upper) | kinematics.turns, axis=0)
            beyond = on_curve & ~inside
            if beyond.any():  # the last point is at the limit
                poses = self._poses.at(samples[own[active[beyond]]])
                end = np.clip(self._nearest(q[:, beyond]), lower, upper)
                end, reached = solve_ik(kinematics, end, *poses)
                off = kinematics.turned(end - here[:, beyond])
                reached &= np.linalg.norm(off, axis=0) < _ON_CURVE
                for k in np.flatnonzero(reached):
                    halves[active[beyond][k]].append(end[:, k])
            going = on_curve & inside
            active, here, tangent = active[going], q[:, going], moves[going, :, 1].T
            tangent = tangent / np.linalg.norm(tangent, axis=0)
            # The start again, perhaps some turns away, closes the curve.
            off = kinematics.turned(here - start[:, own[active]])
            closes = (np.linalg.norm(off, axis=0) < 0.8 * _STEP) & (step > 1)
            for k, point in zip(active, (here - closes * off).T, strict=True):
                halves[k].append(point)
            closed[active[closes]] = True
            # The other half of a closed curve has nothing to add.
            over = closed[active] | closed[(active + count) % (2 * count)]
            active, here, tangent = active[~over], here[:, ~over], tangent[:, ~over]
        curves = []
        for one in range(count):
            ahead, back = halves[one], halves[one + count]
            if closed[one]:
                back = back[:1]
            elif closed[one + count]:
                ahead = ahead[:1]
            curves.append(np.array([*back[:0:-1], *ahead]).T)
        return curves
