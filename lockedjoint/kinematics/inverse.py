"""Inverse kinematics of many configurations at once, and self-motion of a tool pose.

The iteration is one, `_descend`: damped least squares within limits, whose steps are those of
`bounded_step`. `damped_least_squares` leads configurations from anywhere to targets of any
kind: each joint cuts off its own move. `solve_ik` is for configurations that begin near a
pose, along a path: a move that is too long keeps its direction.

These functions have configurations last: q (n, B), n joints, in radians or metres; e (m, B),
what is missing to the targets, m rows; J (m, n, B), the Jacobians; λ (B,), the damping.

An arm with one joint more than its task has rows holds a pose in a curve of configurations.
If joint f locks at θ, the pose is kept if and only if θ is among the values of q_f on these
curves. So the values that each joint sweeps decide about all its failures at once, and no
locked angle is sampled. Curves are followed by tangents of fixed length and Newton's method
(Burdick 1989 for the curves; Hoover, Roberts and Maciejewski 2015 for their use). The
functions for curves have configurations first: q (k, n), with n = m + 1, e (k, m), J (k, m, n).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

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
# Damping is this share of the squared error |e|². If it is larger, the iteration is slower but
# calmer near singular configurations.
DAMPING_SHARE = 0.01
# A joint moves by at most this in one step of `damped_least_squares`. Longer moves leave the
# neighbourhood in which J holds; shorter ones need more steps.
_LONGEST_MOVE_M_OR_RAD = 0.5
# `solve_ik` takes a pose for reached if no entry of what is missing is this large.
TOLERANCE_M_OR_RAD = 1e-5
# A joint moves by at most this in one iteration of `solve_ik`. Longer moves may lead from one
# family of solutions to another.
_LONGEST_STEP_M_OR_RAD = 0.3
# A move counts as at least this when its length is a divisor, so that nothing is divided by 0.
_LEAST_DIVISOR_M_OR_RAD = 1e-12
# Damping in `solve_ik` is at least this, in squared metres and radians. It keeps steps finite
# where J is singular and the error is almost 0.
LEAST_DAMPING = 1e-10
#: A tangent has this length, in radians and units of length. A longer one is faster and loses
#: curves that bend sharply.
STEP = 0.15
# A curve has at most so many tangents in each direction: if fewer, long curves are cut short.
_MOST_TANGENTS = 170
# A start is evaluated at most so often: if less often, fewer poses are found.
_MOST_NEWTON_STEPS = 40
# A pose whose error has a norm below this counts as reached: radians and units of length.
_REACHED_ERROR = 1e-6
# The damping in `solve_pose` is 1 % of |e|², but |e|² counts as this at most: starts are far.
_LARGEST_SQUARED_ERROR = 1.0
# Corrections are of second order: one above this share of a tangent's length loses the curve.
# If it is larger, a curve may jump to another one.
_LOST_SHARE = 0.5
# A curve is closed where it is nearer to its start than this share of a tangent's length. It
# has to be above 1/2, so that no tangent steps over the start, and below 1.
_CLOSED_SHARE = 0.8
# A curve does not close within so many tangents: they are still near the start.
_TANGENTS_BEFORE_CLOSING = 2
# Damping keeps the steps finite where matrices are singular: a larger one bends the result.
_DAMPING = 1e-12
# So many curves are followed at once: more need more memory, fewer more time.
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
    """Return configurations near a start, (n, B), and which of them reach their targets, (B,).

    Parameters
    ----------
    residual
        What is missing to the targets, and J.
    start
        Configurations, shape (n, B), radians or metres.
    lower, upper
        Limits, shape (n, 1) or (n, B): infinite where there are none, equal for locked joints.
    reached
        A target is reached if |e| is below this.
    damping, largest
        λ of a step is damping + 0.01·min(|e|², largest).
    steps
        How often the residual is evaluated: there is one move less.
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
    """Move configurations (n, B) to a pose within the limits; say which reached it, (B,).

    Joints that are free, (n, B) or (n, 1), may move, all by default. There is one pose for all
    or one for each. The argument q is not changed.
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
    return np.clip(move, -_LONGEST_MOVE_M_OR_RAD, _LONGEST_MOVE_M_OR_RAD)


def shortened(move: FloatArray) -> FloatArray:
    """Return moves (n, B), or the part of each that is short enough, in the same direction."""
    largest = np.maximum(np.abs(move).max(axis=0), _LEAST_DIVISOR_M_OR_RAD)
    return np.asarray(move * np.minimum(1, _LONGEST_STEP_M_OR_RAD / largest))


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
    """Move configurations (n, B) until what is missing is near none; say which are, (B,).

    `limited` shortens moves (n, B), `near` says of e (m, B) which targets are reached, (B,).
    The array q is changed in place, and returned. Configurations that are done move no more.
    """
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
        squared_error = np.minimum(np.sum(missing**2, axis=0), largest)
        damped = damping + DAMPING_SHARE * squared_error
        here, least, most = q[:, active], lower[:, active], upper[:, active]
        move = bounded_step(matrix, missing, damped, here, least, most)
        q[:, active] = np.clip(here + limited(move), least, most)
    return q, done


@dataclass(frozen=True, eq=False)
class SelfMotionPoses:
    """Tool poses, one for each of k arms that have one joint more than the task has rows.

    Lengths are in the unit of the arms' axes.
    """

    chain: JointAxes  #: The arms at q = 0: its arrays begin with k, or with 1 for all.
    rows: list[int]  #: The m rows of (v; ω) that are held, n = m + 1.
    tip: FloatArray  #: Where the tool is held, shape (k, 3).
    orientation: FloatArray  #: How the tool is turned from q = 0, shape (k, 3, 3).

    def __len__(self) -> int:
        return len(self.tip)

    def __getitem__(self, which: BoolArray | IntArray) -> SelfMotionPoses:
        """Return some of the poses, by a mask (k,) or by numbers."""
        chain = self.chain
        if len(chain.prismatic) == len(self):
            chain = chain.chosen(which)
        return SelfMotionPoses(chain, self.rows, self.tip[which], self.orientation[which])

    def residual(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what is missing to the poses, (k, m), and the Jacobians there, (k, m, n)."""
        moved, orientation = self.chain.moved(q)
        # This is R·R_nowᵀ: what turns the tool from where it is to where it is held.
        across = self.orientation @ np.swapaxes(orientation, -1, -2)
        turned = rotation_vectors(np.moveaxis(across, 0, -1)).T
        missing = np.concatenate([self.tip - moved.end_effector, turned], axis=1)
        return missing[:, self.rows], moved.velocities()[:, self.rows]


def solve_pose(
    poses: SelfMotionPoses, start: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return configurations (k, n) of the poses near a start, and which were found, (k,).

    The start is (k, n); limits are (n,) or (k, n).
    """

    def residual(which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        missing, matrix = poses[which].residual(q.T)
        return missing.T, np.moveaxis(matrix, 0, -1)

    return reach_poses(residual, start, lower, upper)


def reach_poses(
    residual: Residual, start: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return configurations (k, n) of poses near a start, as `solve_pose`, by any residual."""
    lower, upper = (np.broadcast_to(side, start.shape).T for side in (lower, upper))
    q, reached = damped_least_squares(
        residual,
        start.T,
        lower,
        upper,
        reached=_REACHED_ERROR,
        damping=_DAMPING,
        steps=_MOST_NEWTON_STEPS,
        largest=_LARGEST_SQUARED_ERROR,
    )
    return q.T, reached


class Arcs(NamedTuple):
    """Self-motion curves of k poses, and what the n joints sweep: radians or lengths."""

    #: Configurations in order along each curve, shape (k, 2·steps + 1, n): the start in the
    #: middle, and NaN beyond the ends.
    points: FloatArray
    least: FloatArray  #: The least value that each joint sweeps, turns counted, shape (k, n).
    most: FloatArray  #: The largest one, shape (k, n).


def arcs(
    poses: SelfMotionPoses,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    step: float = STEP,
    steps: int = _MOST_TANGENTS,
    enough: float = np.inf,
) -> Arcs:
    """Follow the self-motion from configurations of the poses, in both directions.

    An arc ends where it closes, at a limit, where it is lost, after so many steps, or when
    every joint has swept all values from −enough to enough. The start, (k, n), has been solved
    for. Limits are (n,); a step is the length of a tangent.
    """
    count, n = start.shape
    points = np.full((count, 2 * steps + 1, n), np.nan)
    points[:, steps] = start
    prismatic = poses.chain.prismatic[0]
    # The last right singular vector of J is what J maps to 0: the curve's first tangent.
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
            correction, following = _newton_step(matrix, missing, tangent)
            here = q + correction
            on_curve = np.linalg.norm(correction, axis=1) < _LOST_SHARE * step
            here, at_limit = _stopped(q - step * tangent, here, lower, upper)
            at_limit = at_limit[on_curve]
            here, active, tangent = here[on_curve], active[on_curve], following[on_curve]
            points[active, steps + sign * k] = here
            # The image is the start again, perhaps some turns away.
            turns = np.round((here - start[active]) / _TURN_RAD) * ~prismatic
            image = start[active] + _TURN_RAD * turns
            near_start = np.linalg.norm(here - image, axis=1) < _CLOSED_SHARE * step
            closed = (k > _TANGENTS_BEFORE_CLOSING) & near_start
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
    return Arcs(points, least, most)


def _newton_step(
    matrix: FloatArray, missing: FloatArray, tangent: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what leads back to each curve, and its next tangent t⁺, (k, n) each.

    Both solve equations of the square matrix [J; tᵀ] with the present tangent t: the right side
    of the correction is (e; 0), so that it is across t, and that of t⁺ is (0; 1), so that t⁺ is
    along the curve and does not turn back. The length of t⁺ is arbitrary.
    """
    count, n = tangent.shape
    square = np.concatenate([matrix, tangent[:, None]], axis=1)
    square[:, range(n), range(n)] += _DAMPING
    sides = np.zeros((count, n, 2))
    sides[:, :-1, 0], sides[:, -1, 1] = missing, 1.0
    moves = np.linalg.solve(square, sides)
    return moves[:, :, 0], moves[:, :, 1]


def covered(
    least: FloatArray, most: FloatArray, half: float, prismatic: BoolArray
) -> BoolArray:
    """Whether every joint sweeps all values from −half to half, shape (k,).

    Least and most values are (k, n), which joints are prismatic (k, n) or (n,). Angles count up
    to full turns.
    """
    # The shift is the smallest number of turns that brings −half to the least value or above.
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
    """Return where moves end, shape (k, n), at the latest at a limit; and which do so, (k,)."""
    move = after - before
    room = np.where(move > 0, upper - before, lower - before)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(move == 0, np.inf, room / move).min(axis=1)
    stopped = fraction < 1
    short = before + np.clip(fraction, 0.0, 1.0)[:, None] * move
    return np.where(stopped[:, None], short, after), stopped
