"""Links: straight pieces from joint to joint, the last one to the end effector.

A joint sits at one point of its axis: the one nearest to the end effector, unless `slide` or
`slide_apart` moves it. The length of a link is the distance between the two points where its
joints sit. What lies before the first joint is the base and no link. The body of a link is a
cylinder of the radius `LINK_RADIUS`.

Arrays: the points of n joints have the shape (…, n, 3), and the end effector (3,), in the
manipulator's unit of length. They broadcast over leading dimensions: many arms at once. The
*size* of a manipulator is `Manipulator.size`, the largest distance between two of its points.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from lockedjoint.kinematics.geometry import segment_distance
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator

# Largest number of sweeps of `slide` over all joints: it ends sooner when nothing moves.
_MOST_SWEEPS = 200
# Largest move of a point in a sweep, in shares of the size, at which nothing moves.
_NO_MOVE_SHARE = 1e-12
# Distance of two joints, as a share of the arm's length, up to which they are in one place.
_TOUCHING_SHARE = 1e-6
# Radius of a link's body, in shares of the manipulator's size.
LINK_RADIUS = 0.012
# Length by which a body that collides is cut short at both ends, in shares of the size.
CUT = 2.5 * LINK_RADIUS
# Largest cut at one end, as a share of the link: something of it is left.
LARGEST_CUT_SHARE = 0.45
# Distance of the middle lines of two bodies up to which they are near, in radii: 2 and some
# room.
_NEAR_RADII = 2.1
# Gap between bodies that is enough for `slide_apart`, in shares of the size: a diameter.
_ENOUGH = 2 * LINK_RADIUS
# Largest slide of a joint, in shares of the size.
_FARTHEST = 0.5
# Number of random moves that `slide_apart` tries in a round: more find larger gaps.
_MOVES = 64
# Number of rounds of `slide_apart`.
_ROUNDS = 80
# Probability that a random move slides a certain joint.
_JOINT_MOVES = 0.5
# Factor by which moves become shorter after a round without a better one.
_SHORTER = 0.85
# Cost of links that are longer by the size, in the unit of the gap's score, from 0 to 1.
_LONGER_COST = 0.02


def link_lengths(points: FloatArray, end_effector: FloatArray) -> FloatArray:
    """Return the lengths of the links, shape (…, n)."""
    return _pieces(points, end_effector)[1]


def clearance(points: FloatArray, end_effector: FloatArray) -> FloatArray:
    """Return the smallest distance between two links that do not meet at a joint, shape (…).

    It is infinite if all links meet. Links meet at a joint also where joints in one place lie
    between them (axes that intersect there, as in a universal joint).
    """
    distances = _distances(points, end_effector, cut_short=False)[1]
    return np.asarray(distances.min(axis=-1, initial=np.inf))


@dataclass(frozen=True)
class LinkGap:
    """The gap between the bodies of links, cylinders about straight pieces."""

    #: The smallest distance between the surfaces of two bodies: below 0 where they overlap,
    #: infinity if there are no two bodies.
    gap: float
    touching: tuple[tuple[int, int], ...]  #: Pairs of links, counted from 0.


def link_gap(manipulator: Manipulator) -> LinkGap:
    """Return the gap between the bodies of a manipulator's links, at q = 0.

    Links that meet at a joint are in one place there. Of two links between which the way along
    the arm is shorter than half of the shorter one, only what lies farther apart along the arm
    counts: two links that are folded onto each other touch, an elbow does not.
    """
    pairs, distances = _distances(manipulator.points, manipulator.end_effector)
    gaps = distances - 2 * LINK_RADIUS * manipulator.size
    touching = tuple(pair for pair, gap in zip(pairs, gaps, strict=True) if gap <= 0)
    return LinkGap(float(np.min(gaps, initial=np.inf)), touching)


def free_parts(manipulator: Manipulator) -> tuple[FloatArray, FloatArray]:
    """Return starts and ends, shape (n, 3) each, of the part of each link that may collide.

    Links are cut short at joints, by `CUT` and, where two links that do not touch would collide
    nevertheless because they meet at a joint, by what `link_gap` leaves out of them.
    """
    points = manipulator.points
    ends, lengths, units = _pieces(points, manipulator.end_effector)
    cuts = np.minimum(CUT * manipulator.size, LARGEST_CUT_SHARE * lengths)
    cuts = np.stack([cuts, cuts])  # at the start, at the end

    def parts() -> tuple[FloatArray, FloatArray]:
        return points + cuts[0, :, None] * units, ends - cuts[1, :, None] * units

    touching = link_gap(manipulator).touching
    starts, stops = parts()
    for i, j in combinations(range(manipulator.joints), 2):
        apart = segment_distance(starts[i], stops[i], starts[j], stops[j])
        if apart > _NEAR_RADII * LINK_RADIUS * manipulator.size or (i, j) in touching:
            continue
        cut = float(_left_out(lengths, i, j))
        cuts[1, i] = max(cuts[1, i], min(cut, LARGEST_CUT_SHARE * lengths[i]))
        cuts[0, j] = max(cuts[0, j], min(cut, LARGEST_CUT_SHARE * lengths[j]))
    return parts()


def _left_out(lengths: FloatArray, i: int, j: int) -> FloatArray:
    """Return how much `link_gap` leaves out of link i at its end and of link j at its start.

    Lengths have the shape (…, n), and i < j. With s the shorter link and b the way between the
    two along the arm, each of them loses max(s/2 − b/2, 0); shape (…).
    """
    shorter = np.minimum(lengths[..., i], lengths[..., j])
    between = lengths[..., i + 1 : j].sum(axis=-1)
    return np.asarray(np.clip(shorter / 2 - between / 2, 0, None))


def _distances(
    points: FloatArray, end_effector: FloatArray, cut_short: bool = True
) -> tuple[list[tuple[int, int]], FloatArray]:
    """Return pairs of links, and the distances of their middle lines, shape (…, pairs).

    A distance is infinite where a pair does not count. With `cut_short` links are cut short as
    `link_gap` says, and pairs with a link of length 0 do not count; without, pairs that meet at
    a joint do not count.
    """
    ends, lengths, units = _pieces(points, end_effector)
    pairs = list(combinations(range(points.shape[-2]), 2))
    distances = np.full((*points.shape[:-2], len(pairs)), np.inf)
    for k, (i, j) in enumerate(pairs):
        start, end, other = points[..., i, :], ends[..., i, :], points[..., j, :]
        size = lengths[..., i + 1 : j].sum(axis=-1)
        if cut_short:
            cut, size = _left_out(lengths, i, j)[..., None], lengths[..., [i, j]].min(axis=-1)
            end, other = end - cut * units[..., i, :], other + cut * units[..., j, :]
        counts = size > _TOUCHING_SHARE * lengths.sum(axis=-1)
        distance = segment_distance(start, end, other, ends[..., j, :])
        distances[..., k] = np.where(counts, distance, np.inf)
    return pairs, distances


def slide_apart(manipulator: Manipulator, seed: int = 0) -> Manipulator:
    """Return the manipulator with its joints slid along their axes until no two links touch.

    It is a search with random moves from a seed, first for the largest gap between bodies up to
    a diameter, then for short links; the Jacobian stays as it is. A joint slides by half of the
    manipulator's size at most. Where nothing is gained the manipulator is returned as it is.
    """
    size, n = manipulator.size, manipulator.joints
    enough = (2 * LINK_RADIUS + _ENOUGH) * size
    own = link_lengths(manipulator.points, manipulator.end_effector).sum()

    def points(ways: FloatArray) -> FloatArray:
        """Return the points when joints slid by ways along their axes, (…, n) → (…, n, 3)."""
        return np.asarray(manipulator.points + ways[..., None] * manipulator.directions)

    def score(ways: FloatArray) -> FloatArray:
        """Return the gap over what is enough, at most 1, minus the cost of longer links."""
        places = points(ways)
        apart = _distances(places, manipulator.end_effector)[1].min(axis=-1, initial=np.inf)
        longer = link_lengths(places, manipulator.end_effector).sum(axis=-1) - own
        return np.asarray(np.minimum(apart, enough) / enough - _LONGER_COST * longer / size)

    rng = np.random.default_rng(seed)
    best, step = np.zeros(n), _FARTHEST / 2 * size
    value = before = float(score(best))
    for _ in range(_ROUNDS):
        some = rng.uniform(size=(_MOVES, n)) < _JOINT_MOVES
        moves = best + step * some * rng.standard_normal((_MOVES, n))
        moves = np.clip(moves, -_FARTHEST * size, _FARTHEST * size)
        values = score(moves)
        winner = int(np.argmax(values))
        if values[winner] > value:
            best, value = moves[winner], float(values[winner])
        else:
            step *= _SHORTER
    slid = replace(manipulator, points=points(best))
    gained = value > before and link_gap(slid).gap > link_gap(manipulator).gap
    return slid if gained else manipulator


def slide(manipulator: Manipulator) -> Manipulator:
    """Return the manipulator with its joints slid along their axes, to the least total length.

    The Jacobian stays as it is. The total length is convex in the points; each in turn goes to
    the best place between its neighbours, until nothing moves. That place is Heron's: turn both
    neighbours about the axis into one plane, on opposite sides, and draw a straight line. With
    the neighbours' feet at a and b on the axis, at the distances r and s from it, the line
    meets the axis at (a s + b r)/(r + s).
    """
    axes, points = manipulator.directions, manipulator.points.copy()
    n = manipulator.joints
    for _ in range(_MOST_SWEEPS):
        before = points.copy()
        for i in range(n):
            after = manipulator.end_effector if i == n - 1 else points[i + 1]
            ahead, off = _along(after, points[i], axes[i])
            if i == 0:
                points[i] = points[i] + ahead * axes[i]
                continue
            behind, away = _along(points[i - 1], points[i], axes[i])
            if off + away > 0:
                points[i] = points[i] + (behind * off + ahead * away) / (off + away) * axes[i]
        if np.max(np.abs(points - before)) < _NO_MOVE_SHARE * manipulator.size:
            break
    return replace(manipulator, points=points)


def _along(target: FloatArray, point: FloatArray, axis: FloatArray) -> tuple[float, float]:
    """Return how far along the axis the foot of a target is, and its distance from the axis."""
    offset = target - point
    ahead = float(offset @ axis)
    return ahead, float(np.linalg.norm(offset - ahead * axis))


def _pieces(
    points: FloatArray, end_effector: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ends, (…, n, 3), lengths, (…, n), and unit vectors, (…, n, 3), of all links.

    A link of length 0 has the direction 0.
    """
    tip = np.broadcast_to(end_effector, (*points.shape[:-2], 1, 3))
    ends = np.concatenate([points[..., 1:, :], tip], axis=-2)
    lengths = np.linalg.norm(ends - points, axis=-1)
    return ends, lengths, (ends - points) / np.where(lengths > 0, lengths, 1)[..., None]
