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

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.following import JUMP, Allowed, march
from lockedjoint.paths.waypoints import Poses

# An arm that keeps self-motion when a joint locks tries again from so many other points of it.
_MOST_RESTARTS = 4
# Points on a curve of the map are this far from each other.
_STEP_M_OR_RAD = 0.15
# A curve of the map has at most so many points in each direction.
_MOST_STEPS = 400
# Inverse kinematics has so many random starts at each sample.
_STARTS_PER_SAMPLE = 180
# So many curves are followed at once at a sample.
_CURVES_AT_ONCE = 5
# Curves start from those of the samples beside at most so often.
_MOST_ROUNDS = 12
# A sample with more points gets no new curves.
_MOST_POINTS = 1500
# A start this near to a point of a curve is on it.
_ON_CURVE_M_OR_RAD = 1.5 * _STEP_M_OR_RAD
# A correction this large is made once more.
_BENT_M_OR_RAD = 0.01
# A correction this large has lost the curve.
_LOST_M_OR_RAD = 0.5 * _STEP_M_OR_RAD


def survivors(
    chain: Chain,
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
    redundant = size - 1 > len(poses.rows)
    centre = 0.1 if redundant else 0.0  # towards mid-range, so that limits come later
    locked, which = np.mgrid[:size, :count].reshape(2, -1)
    first: IntArray = samples[which]
    last, rng, pairs = first.copy(), np.random.default_rng(seed), np.arange(len(first))
    for attempt in range(1 + (_MOST_RESTARTS if redundant else 0)):
        order = pairs[np.argsort(first[pairs], kind="stable")]
        q, joint, start = nodes[:, which[order]], locked[order], first[order]
        if attempt:
            q = _elsewhere(chain, q, joint, start, poses, rng, allowed)
        way = np.full((len(order), 0 if tracks is None else len(poses), size), np.nan)
        if tracks is not None:
            way[np.arange(len(order)), start] = q.T
        given = chain, q, poses, start, 1, joint, centre, allowed
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
    chain: Chain,
    poses: Poses,
    samples: IntArray,
    rng: np.random.Generator,
    iterations: int = 60,
) -> tuple[IntArray, FloatArray]:
    """Draw a start for each of some samples, and move it to the pose there, within the limits.

    Returns the samples that were reached, (B,), and configurations there, (n, B).
    """
    least, largest = chain.ranges
    drawn = rng.uniform(least, largest, (len(least), len(samples)))
    q, reached = solve_ik(chain, drawn, poses.at(samples), iterations=iterations)
    return samples[reached], q[:, reached]


def _elsewhere(
    chain: Chain,
    q: FloatArray,
    joint: IntArray,
    samples: IntArray,
    poses: Poses,
    rng: np.random.Generator,
    allowed: Allowed | None,
) -> FloatArray:
    """Move along the self-motion that the locked arm keeps, in steps at the same pose."""
    free = np.arange(len(q))[:, None] != joint
    target = poses.at(samples)
    push = rng.normal(size=q.shape)
    push *= 0.25 / np.sqrt(np.sum(push**2, axis=0))
    for _ in range(int(rng.integers(2, 9))):
        shifted = np.clip(q + push * free, chain.lower, chain.upper)
        moved, reached = solve_ik(chain, shifted, target, free)
        reached &= np.max(np.abs(moved - q), axis=0) < JUMP
        if allowed is not None:
            reached[reached] = allowed(q[:, reached], moved[:, reached])
        q = np.where(reached, moved, q)
    return q


def near_pairs(
    q: FloatArray, other: FloatArray | None, most: FloatArray, turns: BoolArray
) -> tuple[IntArray, IntArray]:
    """Return the pairs of configurations (n, B) whose joints are at most (n,) apart.

    Without others each pair among themselves once. Whole turns do not count for those of
    ``turns``, shape (n, 1).
    """
    scale = np.maximum(most, 1e-9)[:, None]
    tree = _tree(q, turns, scale)
    if other is None:
        first, second = tree.query_pairs(1.0, p=np.inf, output_type="ndarray").T
        return first, second
    there = _tree(other, turns, scale)
    pairs = tree.sparse_distance_matrix(there, 1.0, p=np.inf, output_type="coo_matrix")
    return pairs.row.astype(int), pairs.col.astype(int)


def _tree(q: FloatArray, turns: BoolArray, scale: FloatArray | float = 1.0) -> cKDTree:
    """Return a tree of configurations (n, B), in which joints that turn are circles."""
    circle = np.where(turns, 2 * np.pi / scale, 0.0)[:, 0]
    inside = np.where(turns, np.mod(q, 2 * np.pi), q) / scale
    # A rounding error must not put a point beside its circle.
    most = np.where(turns, np.nextafter(circle, 0)[:, None], np.inf)
    return cKDTree(np.minimum(inside, most).T, leafsize=32, boxsize=circle)


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
            chain, poses, np.repeat(np.arange(count), _STARTS_PER_SAMPLE), rng, 25
        )
        tried = 0
        for _ in range(_MOST_ROUNDS):
            self._add(samples, q)
            # Points of the new curves are starts at the samples before and after.
            new = slice(tried, None, 3)
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
        """Estimate the last sample reached after joint f locks at each point, (n, B) each."""
        chain, final = self._chain, len(self._poses) - 1
        there = self.points(final)
        ends = [np.full(there.shape, final)]
        most = np.full(len(chain.joints), JUMP + _ON_CURVE_M_OR_RAD)
        for k in reversed(range(final)):
            here, later = self.points(k), ends[-1]
            last = np.full(here.shape, k)
            # Points here are paired with beginnings of arcs there that may pass near them.
            point, first = near_pairs(here, there, most, chain.whole_turns)
            curve = self._curves[self._samples == k + 1]
            goes_on = np.append(curve[1:] == curve[:-1], False)[first]
            point, first = point[goes_on], first[goes_on]
            off = chain.turned(here[:, point] - there[:, first])
            arcs = chain.turned(there[:, first + 1] - there[:, first])
            for f, width in enumerate(arcs):
                share = np.full(len(width), -1.0)
                np.divide(off[f], width, out=share, where=width != 0)
                met = (share >= 0) & (share <= 1)
                at, arc, share = point[met], first[met], share[met]
                gap = np.max(np.abs(share * arcs[:, met] - off[:, met]), axis=0)
                # The nearest passage of each point counts.
                order = np.lexsort((gap, at))
                order = order[np.unique(at[order], return_index=True)[1]]
                order = order[gap[order] < JUMP]
                last[f, at[order]] = later[f, arc[order] + (share[order] > 0.5)]
            ends.append(last)
            there = here
        return ends[::-1]

    def _nearest(self, q: FloatArray) -> FloatArray:
        middle = self._chain.mid_range[:, None]
        return middle + self._chain.turned(q - middle)

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
            owner, points = self._followed(at, starts)
            # The first of several starts on one curve counts.
            asked = self._tree(at, starts).data
            near = self._tree(at[owner], points).query_ball_point(asked, _ON_CURVE_M_OR_RAD)
            first = np.array([np.min(owner[own]) for own in near])
            kept = (first == np.arange(len(at)))[owner]
            self._q = np.concatenate([self._q, self._nearest(points[:, kept])], axis=1)
            self._samples = np.concatenate([self._samples, at[owner[kept]]])
            self._curves = np.concatenate([self._curves, known + owner[kept]])
            samples, q = samples[~chosen], q[:, ~chosen]

    def _fresh(self, samples: IntArray, q: FloatArray, known: int) -> BoolArray:
        """Whether configurations are on no curve, but for points ``known``, shape (B,).

        None is where there are enough points.
        """
        tree = self._tree(self._samples[known:], self._q[:, known:])
        asked = self._tree(samples, q).data
        away = np.isinf(tree.query(asked, distance_upper_bound=_ON_CURVE_M_OR_RAD)[0])
        crowded = np.bincount(self._samples, minlength=len(self._poses)) > _MOST_POINTS
        return np.asarray(away & ~crowded[samples])

    def _tree(self, samples: IntArray, q: FloatArray) -> cKDTree:
        """Return a tree of configurations in which those of other samples are far away."""
        turns = np.append(self._chain.whole_turns, [[False]], axis=0)
        return _tree(np.concatenate([q, 10.0 * samples[None]]), turns)

    def _correction(self, samples: IntArray, q: FloatArray, tangent: FloatArray) -> FloatArray:
        """Return the step to the curve across a tangent, and the tangent there, (B, n, 2)."""
        position, orientation, matrix = self._chain.forward(q, self._poses.rows)
        missing = self._poses.at(samples).missing(position, orientation)
        square = np.moveaxis(np.concatenate([matrix, tangent[None]]), -1, 0)
        sides = np.zeros((q.shape[1], len(q), 2))
        sides[:, :-1, 0], sides[:, -1, 1] = missing.T, 1.0
        return np.asarray(np.linalg.solve(square + 1e-12 * np.eye(len(q)), sides))

    def _followed(self, samples: IntArray, start: FloatArray) -> tuple[IntArray, FloatArray]:
        """Follow curves both ways, to where they close, or end at a limit.

        Returns to which start each point belongs, and points, (n, P), in order along each
        curve.
        """
        chain, count = self._chain, start.shape[1]
        lower, upper = chain.lower, chain.upper
        matrix = np.moveaxis(chain.forward(start, self._poses.rows)[2], -1, 0)
        tangent = np.linalg.svd(matrix)[2][:, -1].T
        # Each curve has two halves: one runs along the tangent, the other against it.
        half, side = np.tile(np.arange(count), 2), np.repeat([1, -1], count)
        here, tangent = start[:, half], side * tangent[:, half]
        closed = np.zeros(count, dtype=int)  # by which half, if by one
        parts = [(half[:count], 0 * half[:count], start)]
        beyond = [(half[:0], half[:0], start[:, :0], start[:, :0])]
        for step in range(1, _MOST_STEPS + 1):
            q = here + _STEP_M_OR_RAD * tangent
            moves = self._correction(samples[half], q, tangent)
            q, tangent = q + moves[:, :, 0].T, moves[:, :, 1].T
            # Where the curve bends, one correction does not lead to it.
            bent = np.flatnonzero(np.linalg.norm(moves[:, :, 0], axis=1) > _BENT_M_OR_RAD)
            more = self._correction(samples[half[bent]], q[:, bent], tangent[:, bent])
            q[:, bent] += more[:, :, 0].T
            on_curve = np.linalg.norm(moves[:, :, 0], axis=1) < _LOST_M_OR_RAD
            inside = np.all((q >= lower) & (q <= upper) | chain.whole_turns, axis=0)
            out = on_curve & ~inside
            beyond.append((half[out], step * side[out], q[:, out], here[:, out]))
            # The start again, perhaps some turns away, closes the curve.
            off = chain.turned(q - start[:, half])
            going = on_curve & inside
            closes = going & (np.linalg.norm(off, axis=0) < 0.8 * _STEP_M_OR_RAD) & (step > 2)
            closed[half[closes]] = side[closes]
            q = q - closes * off
            parts.append((half[going], step * side[going], q[:, going]))
            # The other half of a closed curve has nothing to add.
            going &= closed[half] == 0
            half, side, here = half[going], side[going], q[:, going]
            tangent = tangent[:, going] / np.linalg.norm(tangent[:, going], axis=0)
            if not len(half):
                break
        # The last point of a half that ends at a limit is there.
        owner, place, q, before = (
            np.concatenate(part, -1) for part in zip(*beyond, strict=True)
        )
        end = np.clip(self._nearest(q), lower, upper)
        end, reached = solve_ik(chain, end, self._poses.at(samples[owner]))
        reached &= np.linalg.norm(chain.turned(end - before), axis=0) < _ON_CURVE_M_OR_RAD
        parts.append((owner[reached], place[reached], end[:, reached]))
        owner, place, q = (np.concatenate(part, -1) for part in zip(*parts, strict=True))
        order = np.lexsort((place, owner))
        order = order[(closed[owner] * place)[order] >= 0]
        return owner[order], q[:, order]
