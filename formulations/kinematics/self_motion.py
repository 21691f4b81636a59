"""Self-motion of a tool pose: arcs of configurations, many at once, and what joints sweep.

An arm with one joint more than its task has rows holds a pose in a curve of configurations.
If joint f locks at θ, the pose is kept if and only if θ is among the values of q_f on these
curves. So the values that each joint sweeps decide about all its failures at once, and no
locked angle is sampled. Curves are followed by tangents of fixed length and Newton's method
(Burdick 1989 for the curves; Hoover, Roberts and Maciejewski 2015 for their use).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formulations.kinematics.inverse import damped_least_squares
from formulations.kinematics.link_chain import BoolArray, IntArray, LinkChain, rotation_vectors
from nlp.arrays import FloatArray

#: Length of a tangent, in radians and units of length.
STEP = 0.15
#: Tangents in each direction, at most.
_STEPS = 170
#: Steps of Newton's method from a start, and the residual that counts as reached.
_NEWTON, _REACHED = 40, 1e-6
# On a curve, the residual after a tangent is of second order; above this the curve is lost.
_LOST = 0.5
_DAMPING = 1e-12
# So many curves are followed at once, which bounds the memory.
_CHUNK = 2000
_TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class SelfMotionPoses:
    """Tool poses, one for each of k arms that have one joint more than the task has rows.

    Attributes
    ----------
    chain
        The arms at q = 0, with k or one in front.
    rows
        Rows of (v; ω) that are held.
    tip
        Where the tool is held, shape (k, 3).
    orientation
        How the tool is turned from q = 0, shape (k, 3, 3).
    """

    chain: LinkChain
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
    poses: SelfMotionPoses,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Return configurations (k, n) of the poses near a start, and which ones were found.

    See `damped_least_squares`.
    """

    def residual(which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        missing, matrix = poses[which].residual(q.T)
        return missing.T, np.moveaxis(matrix, 0, -1)

    lower, upper = (np.broadcast_to(side, start.shape).T for side in (lower, upper))
    q, reached = damped_least_squares(
        *(residual, start.T, lower, upper),
        reached=_REACHED,
        damping=_DAMPING,
        steps=_NEWTON,
        largest=1.0,
    )
    return q.T, reached


def arcs(
    poses: SelfMotionPoses,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    step: float = STEP,
    steps: int = _STEPS,
    enough: float = np.inf,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Follow the self-motion from configurations of the poses, in both directions.

    An arc ends where it closes, at a limit, or where it is lost.

    Parameters
    ----------
    poses, start, lower, upper
        See `damped_least_squares`; the start has been solved for.
    step, steps
        Length of a tangent, and how many at most in each direction.
    enough
        An arc also ends when every joint has swept all values from −enough to enough.

    Returns
    -------
    numpy.ndarray
        Configurations in order along each curve, shape (k, 2·steps + 1, n), the start in the
        middle; NaN beyond the ends.
    numpy.ndarray
        The least values that each joint sweeps, shape (k, n). Turns are counted.
    numpy.ndarray
        The largest ones.
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
            # A step back to the curve across the tangent, and the next tangent.
            square = np.concatenate([matrix, tangent[:, None]], axis=1)
            square[:, range(n), range(n)] += _DAMPING
            sides = np.zeros((len(active), n, 2))
            sides[:, :-1, 0], sides[:, -1, 1] = missing, 1.0
            moves = np.linalg.solve(square, sides)
            here = q + moves[:, :, 0]
            on_curve = np.linalg.norm(moves[:, :, 0], axis=1) < _LOST * step
            here, at_limit = _stopped(q - step * tangent, here, lower, upper)
            at_limit = at_limit[on_curve]
            here, active, tangent = here[on_curve], active[on_curve], moves[on_curve, :, 1]
            points[active, steps + sign * k] = here
            # The start again, perhaps some turns away.
            turns = np.round((here - start[active]) / _TURN) * ~prismatic
            image = start[active] + _TURN * turns
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
    shift = _TURN * np.ceil((least + half) / _TURN)
    turned = (half + shift <= most) | (most - least >= _TURN)
    travelled = (least <= -half) & (most >= half)
    return np.asarray(np.all(np.where(prismatic, travelled, turned), axis=1))


def kept(chain: LinkChain, rows: list[int], offsets: FloatArray, half: float) -> BoolArray:
    """Whether positions of the tool are kept whichever joint fails, shape (N, S).

    A position is kept if the arm reaches it with every joint within ±half of q = 0, and the
    self-motion curve through that configuration takes every joint over all of ±half, with no
    other limits. Rows that rotate the tool are held as at q = 0. Other curves of the same pose
    are not looked at: what is kept may be more.

    Parameters
    ----------
    chain
        N arms at q = 0, with one joint more than there are rows.
    rows
        Rows of (v; ω) that are held.
    offsets
        From the end effector to the positions, shape (S, 3).
    half
        Half-width of the artificial limits, in radians and units of length.
    """
    arms, n = chain.prismatic.shape
    pairs = np.indices((arms, len(offsets))).reshape(2, -1)
    limits, none = np.full(n, half), np.full(n, np.inf)
    survives = np.zeros(pairs.shape[1], dtype=bool)
    for at in range(0, len(survives), _CHUNK):
        arm, point = pairs[:, at : at + _CHUNK]
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
