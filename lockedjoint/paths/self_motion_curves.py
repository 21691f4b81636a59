"""Follow curves of configurations that hold a pose, in steps of equal length.

An arm with one joint more than its task has rows holds a pose along such curves. A curve is
followed from a start both ways, as two halves, until it closes or leaves the limits. A step
goes along the tangent, and one Newton step, or two where the curve bends, returns to it.

n is the number of joints, m = n − 1 of rows of the task, C of curves, H of the halves that are
still followed, and P of points. Configurations are in rad or m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.waypoints import Poses

#: Length of a step: points on a curve are this far from each other.
STEP_M_OR_RAD = 0.15
#: Distance from a point of a curve below which a configuration is on that curve.
ON_CURVE_M_OR_RAD = 1.5 * STEP_M_OR_RAD
# Length of a correction from which another one is made: there the curve bends.
_BENT_M_OR_RAD = 0.01
# Length of a correction from which the curve is lost.
_LOST_M_OR_RAD = 0.5 * STEP_M_OR_RAD
# Distance from the start below which a curve is closed.
_CLOSED_M_OR_RAD = 0.8 * STEP_M_OR_RAD
# Number of the last step at which a curve is still next to its start without being closed.
_STEPS_BESIDE_START = 2
# Largest number of points of a curve in each direction.
_MOST_STEPS = 400
# Number that is added to the diagonal of the equations of a correction, so that they have a
# solution where the tangent is not unique.
_REGULARISATION = 1e-12


class _Points(NamedTuple):
    """Points on curves.

    Attributes
    ----------
    start
        Number of the start from which the curve is followed, shape (P,).
    place
        Number of steps from the start, negative against the first tangent, shape (P,).
    q
        Configurations, shape (n, P).
    """

    start: IntArray
    place: IntArray
    q: FloatArray


class _Beyond(NamedTuple):
    """First points beyond a limit, as in `_Points`, and `before`, the points before these."""

    start: IntArray
    place: IntArray
    q: FloatArray
    before: FloatArray


class _Corrected(NamedTuple):
    """Points after a step and tangents, (n, H) both, and which points are on a curve, (H,)."""

    q: FloatArray
    tangent: FloatArray
    on_curve: BoolArray


def followed(
    chain: Chain, poses: Poses, samples: IntArray, start: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Follow curves both ways, to where they close, or end at a limit.

    `samples` has the sample of each start, (C,), and `start` configurations there, (n, C).
    Returns to which start each point belongs, (P,), and points, (n, P), in order along each
    curve.
    """
    count = start.shape[1]
    matrix = np.moveaxis(chain.forward(start, poses.rows)[2], -1, 0)
    tangent = np.linalg.svd(matrix)[2][:, -1].T
    # Each curve has two halves: one runs along the tangent, the other against it. `half` is the
    # number of the start, (H,), `side` is 1 or −1, (H,), `here` and `tangent` are (n, H).
    half, side = np.tile(np.arange(count), 2), np.repeat([1, -1], count)
    here, tangent = start[:, half], side * tangent[:, half]
    # The side whose half closes a curve, 0 if none does.
    closed = np.zeros(count, dtype=int)
    parts = [_Points(half[:count], 0 * half[:count], start)]
    beyond = [_Beyond(half[:0], half[:0], start[:, :0], start[:, :0])]
    for step in range(1, _MOST_STEPS + 1):
        predicted = here + STEP_M_OR_RAD * tangent
        q, tangent, on_curve = _corrected(chain, poses, samples[half], predicted, tangent)
        inside = np.all((q >= chain.lower) & (q <= chain.upper) | chain.whole_turns, axis=0)
        out = on_curve & ~inside
        beyond.append(_Beyond(half[out], step * side[out], q[:, out], here[:, out]))
        # The start again, perhaps some turns away, closes the curve.
        off = chain.turned(q - start[:, half])
        going = on_curve & inside
        near = np.linalg.norm(off, axis=0) < _CLOSED_M_OR_RAD
        closes = going & near & (step > _STEPS_BESIDE_START)
        closed[half[closes]] = side[closes]
        q = q - closes * off
        parts.append(_Points(half[going], step * side[going], q[:, going]))
        # The other half of a closed curve has nothing to add.
        going &= closed[half] == 0
        half, side, here = half[going], side[going], q[:, going]
        tangent = tangent[:, going] / np.linalg.norm(tangent[:, going], axis=0)
        if not len(half):
            break
    ends = _Beyond(*(np.concatenate(part, -1) for part in zip(*beyond, strict=True)))
    parts.append(_ends_at_limits(chain, poses, samples, ends))
    points = _Points(*(np.concatenate(part, -1) for part in zip(*parts, strict=True)))
    order = np.lexsort((points.place, points.start))
    order = order[(closed[points.start] * points.place)[order] >= 0]
    return points.start[order], points.q[:, order]


def nearest_turn(chain: Chain, q: FloatArray) -> FloatArray:
    """Return configurations (n, B) less the whole turns that take them nearest mid-range."""
    middle = chain.mid_range[:, None]
    return middle + chain.turned(q - middle)


def _corrected(
    chain: Chain, poses: Poses, samples: IntArray, q: FloatArray, tangent: FloatArray
) -> _Corrected:
    """Return points on the curves next to `q`, (n, H), and the tangents of the curves at `q`.

    One Newton step leads there, and a second one where the first is long. `samples` is (H,).
    """
    moves, turned = _newton_step(chain, poses, samples, q, tangent)
    lengths = np.linalg.norm(moves, axis=0)
    reached = q + moves
    bent = np.flatnonzero(lengths > _BENT_M_OR_RAD)
    more, _ = _newton_step(chain, poses, samples[bent], reached[:, bent], turned[:, bent])
    reached[:, bent] += more
    return _Corrected(reached, turned, lengths < _LOST_M_OR_RAD)


def _newton_step(
    chain: Chain, poses: Poses, samples: IntArray, q: FloatArray, tangent: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the step dq from `q` to the curve, and the new tangent τ', (n, H) both.

    They solve [J; τᵀ]dq = (missing; 0) and [J; τᵀ]τ' = (0; 1), with J the Jacobian at `q`,
    (m, n), and τ the tangent before.
    """
    size, count = q.shape
    position, orientation, matrix = chain.forward(q, poses.rows)
    missing = poses.at(samples).missing(position, orientation)
    square = np.moveaxis(np.concatenate([matrix, tangent[None]]), -1, 0)
    sides = np.zeros((count, size, 2))
    sides[:, :-1, 0], sides[:, -1, 1] = missing.T, 1.0
    # dq and τ' are the two columns, shape (H, n, 2).
    equations = square + _REGULARISATION * np.eye(size)
    both = np.asarray(np.linalg.solve(equations, sides), dtype=float)
    return both[:, :, 0].T, both[:, :, 1].T


def _ends_at_limits(chain: Chain, poses: Poses, samples: IntArray, beyond: _Beyond) -> _Points:
    """Return the last points of halves that leave the limits: those at the limit."""
    end = np.clip(nearest_turn(chain, beyond.q), chain.lower, chain.upper)
    end, reached = solve_ik(chain, end, poses.at(samples[beyond.start]))
    moved = np.linalg.norm(chain.turned(end - beyond.before), axis=0)
    reached &= moved < ON_CURVE_M_OR_RAD
    return _Points(beyond.start[reached], beyond.place[reached], end[:, reached])
