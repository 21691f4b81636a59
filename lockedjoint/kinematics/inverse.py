"""Inverse kinematics of many configurations at once, and self-motion of a tool pose.

The iteration is one, `_descend`: damped least squares within limits, whose steps are those of
`bounded_step`. `damped_least_squares` leads configurations from anywhere to targets of any
kind. `solve_ik` is for those that begin near a pose, along a path: a step that is too long
keeps its direction.

An arm with one joint more than its task has rows holds a pose in a curve of configurations.
If joint f locks at θ, the pose is kept if and only if θ is among the values of q_f on these
curves. So the values that each joint sweeps decide about all its failures at once, and no
locked angle is sampled. Curves are followed by tangents of fixed length and Newton's method
(Burdick 1989 for the curves; Hoover, Roberts and Maciejewski 2015 for their use).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from lockedjoint.kinematics.bounded_step import bounded_step
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray, rotation_vectors
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.kinematics.tool_poses import ToolPoses
from lockedjoint.nlp.arrays import FloatArray

#: A residual takes the numbers of B targets and their configurations, shape (n, B). It returns
#: what is missing to the targets, shape (m, B), and the Jacobians, shape (m, n, B).
Residual: TypeAlias = Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]]
# Damping is this share of the squared error.
DAMPING_SHARE = 0.01
# A joint moves by at most this in one step of `damped_least_squares`: radians or metres.
_LONGEST_MOVE = 0.5
# `solve_ik` takes a pose for reached if no entry of what is missing is larger.
TOLERANCE_M_OR_RAD = 1e-5
# A joint moves by at most this in one iteration of `solve_ik`: radians or metres.
_LONGEST_STEP = 0.3
# Damping in `solve_ik` is at least this: squared metres and radians.
LEAST_DAMPING = 1e-10
#: A tangent has this length, in radians and units of length.
STEP = 0.15
#: A curve has at most so many tangents in each direction.
_MOST_TANGENTS = 170
#: Newton's method takes at most so many steps from a start.
_MOST_NEWTON_STEPS = 40
#: A pose with this residual counts as reached: radians and units of length.
_REACHED_RESIDUAL = 1e-6
# Corrections are of second order: one above this share of a tangent's length loses the curve.
_LOST_SHARE = 0.5
# Damping keeps the steps finite where matrices are singular.
_DAMPING = 1e-12
# The number of curves that are followed at once bounds the memory.
_CURVES_AT_ONCE = 2000
# A turn has this angle.
_TURN_RAD = 2 * np.pi


def damped_least_squares(
    residual: Residual,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    *,
    reached: float,
    damping: float,
    steps: int,
    largest: float = np.inf,
) -> tuple[FloatArray, BoolArray]:
    """Return configurations near a start, shape (n, B), and which of them reach their targets.

    Steps are those of `bounded_step`, of which each joint moves at most 0.5, within its limits,
    shape (n, 1) or (n, B), infinite where there are none and equal for locked joints. Reached
    is a norm of what is missing, e; λ is the damping and 1 % of |e|², up to the largest.
    """

    def near(missing: FloatArray) -> BoolArray:
        return np.asarray(np.sum(missing**2, axis=0) < reached**2)

    q = np.clip(start, lower, upper)
    return _descend(residual, q, (lower, upper), _cut_off, near, steps, damping, largest)


def solve_ik(
    chain: Chain,
    q: FloatArray,
    poses: ToolPoses,
    free: BoolArray | None = None,
    iterations: int = 6,
) -> tuple[FloatArray, BoolArray]:
    """Move configurations (n, B) to a pose within the limits; say which of them reached it.

    Joints that are free, (n, B) or (n, 1), may move, all by default.
    """

    def residual(which: IntArray, here: FloatArray) -> tuple[FloatArray, FloatArray]:
        position, orientation, matrix = chain.forward(here, poses.rows)
        return poses.chosen(which).missing(position, orientation), matrix

    def near(missing: FloatArray) -> BoolArray:
        return np.asarray(np.max(np.abs(missing), axis=0) < TOLERANCE_M_OR_RAD)

    limits = chain.lower, chain.upper
    if free is not None:
        limits = np.where(free, chain.lower, q), np.where(free, chain.upper, q)
    evaluations = iterations + 1
    return _descend(residual, q.copy(), limits, shortened, near, evaluations, LEAST_DAMPING)


def _cut_off(move: FloatArray) -> FloatArray:
    """Return moves (n, B), of which each joint makes what is short enough."""
    return np.clip(move, -_LONGEST_MOVE, _LONGEST_MOVE)


def shortened(move: FloatArray) -> FloatArray:
    """Return moves (n, B), or the part of each that is short enough, in the same direction."""
    largest = np.maximum(np.abs(move).max(axis=0), 1e-12)
    return np.asarray(move * np.minimum(1, _LONGEST_STEP / largest))


def _descend(
    residual: Residual,
    q: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    limited: Callable[[FloatArray], FloatArray],
    near: Callable[[FloatArray], BoolArray],
    evaluations: int,
    damping: float,
    largest: float = np.inf,
) -> tuple[FloatArray, BoolArray]:
    """Move configurations (n, B) until what is missing is near none; say which of them are."""
    lower, upper = (np.broadcast_to(side, q.shape) for side in limits)
    done, active = np.zeros(q.shape[1], dtype=bool), np.arange(q.shape[1])
    for k in range(evaluations):
        missing, matrix = residual(active, np.take(q, active, axis=1))
        away = ~near(missing)
        done[active[~away]] = True
        active = active[away]
        missing, matrix = (np.compress(away, part, -1) for part in (missing, matrix))
        if not active.size or k == evaluations - 1:
            break
        share = damping + DAMPING_SHARE * np.minimum(np.sum(missing**2, axis=0), largest)
        here, least, most = q[:, active], lower[:, active], upper[:, active]
        move = bounded_step(matrix, missing, share, here, least, most)
        q[:, active] = np.clip(here + limited(move), least, most)
    return q, done


@dataclass(frozen=True, eq=False)
class SelfMotionPoses:
    """Tool poses, one for each of k arms that have one joint more than the task has rows.

    Arms at q = 0, with k or one in front; rows of (v; ω) that are held; where the tool is held,
    shape (k, 3); and how it is turned from q = 0, (k, 3, 3).
    """

    chain: JointAxes
    rows: list[int]
    tip: FloatArray
    orientation: FloatArray

    def __len__(self) -> int:
        return len(self.tip)

    def __getitem__(self, which: BoolArray | IntArray) -> SelfMotionPoses:
        chain = self.chain
        if len(chain.prismatic) == len(self):
            chain = chain.chosen(which)
        return SelfMotionPoses(chain, self.rows, self.tip[which], self.orientation[which])

    def residual(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what is missing to the poses, (k, m), and the Jacobians there, (k, m, n)."""
        moved, orientation = self.chain.moved(q)
        across = self.orientation @ np.swapaxes(orientation, -1, -2)
        turned = rotation_vectors(np.moveaxis(across, 0, -1)).T
        missing = np.concatenate([self.tip - moved.end_effector, turned], axis=1)
        return missing[:, self.rows], moved.velocities()[:, self.rows]


def solve_pose(
    poses: SelfMotionPoses, start: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return configurations (k, n) of the poses near a start, and which ones were found."""

    def residual(which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        missing, matrix = poses[which].residual(q.T)
        return missing.T, np.moveaxis(matrix, 0, -1)

    lower, upper = (np.broadcast_to(side, start.shape).T for side in (lower, upper))
    q, reached = damped_least_squares(
        residual,
        start.T,
        lower,
        upper,
        reached=_REACHED_RESIDUAL,
        damping=_DAMPING,
        steps=_MOST_NEWTON_STEPS,
        largest=1.0,
    )
    return q.T, reached


def arcs(
    poses: SelfMotionPoses,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    step: float = STEP,
    steps: int = _MOST_TANGENTS,
    enough: float = np.inf,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Follow the self-motion from configurations of the poses, in both directions.

    An arc ends where it closes, at a limit, where it is lost, after so many steps, or when
    every joint has swept all values from −enough to enough. The start has been solved for.

    Returned are configurations in order along each curve, shape (k, 2·steps + 1, n), the start
    in the middle and NaN beyond the ends; and the least and the largest values that each joint
    sweeps, shape (k, n) each, turns counted.
    """
    count, n = start.shape
    points = np.full((count, 2 * steps + 1, n), np.nan)
    points[:, steps] = start
    prismatic = poses.chain.prismatic[0]
    first = np.linalg.svd(poses.residual(start)[1])[2][:, -1]
    least, most = start.copy(), start.copy()
    unfinished = np.ones(count, dtype=bool)
    for sign in (1, -1):
        active = np.flatnonzero(unfinished)
        tangent = sign * first[active]
        q = start[active] + step * tangent
        for k in range(1, steps + 1):
            if not len(active):
                break
            missing, matrix = poses[active].residual(q)
            # One column leads back to the curve, across the tangent; the other is the next
            # tangent.
            square = np.concatenate([matrix, tangent[:, None]], axis=1)
            square[:, range(n), range(n)] += _DAMPING
            sides = np.zeros((len(active), n, 2))
            sides[:, :-1, 0], sides[:, -1, 1] = missing, 1.0
            moves = np.linalg.solve(square, sides)
            here = q + moves[:, :, 0]
            on_curve = np.linalg.norm(moves[:, :, 0], axis=1) < _LOST_SHARE * step
            here, at_limit = _stopped(q - step * tangent, here, lower, upper)
            at_limit = at_limit[on_curve]
            here, active, tangent = here[on_curve], active[on_curve], moves[on_curve, :, 1]
            points[active, steps + sign * k] = here
            # The image is the start again, perhaps some turns away.
            turns = np.round((here - start[active]) / _TURN_RAD) * ~prismatic
            image = start[active] + _TURN_RAD * turns
            closed = (k > 2) & (np.linalg.norm(here - image, axis=1) < 0.8 * step)
            last = np.where(closed[:, None], image, here)
            least[active] = np.minimum(np.minimum(least[active], here), last)
            most[active] = np.maximum(np.maximum(most[active], here), last)
            over = closed  # the other direction has nothing to add
            if enough < np.inf:
                over = over | covered(least[active], most[active], enough, prismatic)
            unfinished[active[over]] = False
            ended = over | at_limit
            here, active, tangent = here[~ended], active[~ended], tangent[~ended]
            tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
            q = here + step * tangent
    return points, least, most


def covered(
    least: FloatArray, most: FloatArray, half: float, prismatic: BoolArray
) -> BoolArray:
    """Whether every joint sweeps all values from −half to half, shape (k,).

    Angles count up to full turns.
    """
    shift = _TURN_RAD * np.ceil((least + half) / _TURN_RAD)
    turned = (half + shift <= most) | (most - least >= _TURN_RAD)
    travelled = (least <= -half) & (most >= half)
    return np.asarray(np.all(np.where(prismatic, travelled, turned), axis=1))


def kept(chain: JointAxes, rows: list[int], offsets: FloatArray, half: float) -> BoolArray:
    """Whether positions of the tool are kept whichever joint fails, shape (N, S).

    A position is kept if the arm reaches it with every joint within ±half of q = 0, and the
    self-motion curve through that configuration takes every joint over all of ±half, with no
    other limits. Rows that rotate the tool are held as at q = 0. Other curves of the same pose
    are not looked at: what is kept may be more. The N arms, at q = 0, have one joint more than
    there are rows; offsets are from the end effector to the positions, shape (S, 3).
    """
    arms, n = chain.prismatic.shape
    pairs = np.indices((arms, len(offsets))).reshape(2, -1)
    limits, none = np.full(n, half), np.full(n, np.inf)
    survives = np.zeros(pairs.shape[1], dtype=bool)
    for at in range(0, len(survives), _CURVES_AT_ONCE):
        arm, point = pairs[:, at : at + _CURVES_AT_ONCE]
        orientation = np.broadcast_to(np.eye(3), (len(arm), 3, 3))
        poses = SelfMotionPoses(
            chain.chosen(arm), rows, chain.end_effector + offsets[point], orientation
        )
        q, reached = solve_pose(poses, np.zeros((len(arm), n)), -limits, limits)
        if not reached.any():
            continue
        _, least, most = arcs(poses[reached], q[reached], -none, none, enough=half)
        swept = covered(least, most, half, chain.prismatic[arm][reached])
        survives[at + np.flatnonzero(reached)] = swept
    return survives.reshape(arms, len(offsets))


def _stopped(
    before: FloatArray, after: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return where tangents end at the latest, shape (k, n): at a limit; and which do."""
    move = after - before
    room = np.where(move > 0, upper - before, lower - before)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(move == 0, np.inf, room / move).min(axis=1)
    stopped = share < 1
    short = before + np.clip(share, 0.0, 1.0)[:, None] * move
    return np.where(stopped[:, None], short, after), stopped
