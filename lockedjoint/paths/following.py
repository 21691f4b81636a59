"""Many configurations that follow a path, each from its own sample: damped least squares.

They do not wait for each other: one that has reached a sample goes on to the next in the
iteration after. Each iteration then is one of many configurations, which is what NumPy is fast
at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np

from lockedjoint.kinematics.bounded_step import bounded_step
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.inverse import (
    DAMPING_SHARE,
    LEAST_DAMPING,
    TOLERANCE_M_OR_RAD,
    shortened,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.waypoints import Poses

#: Ways lead from configurations to others, (n, B) each: the function says which the arm may go,
#: shape (B,).
Allowed: TypeAlias = Callable[[FloatArray, FloatArray], BoolArray]
# A joint that moves further between two samples has jumped to another solution, or the arm
# passes a singularity: radians or metres.
JUMP = 0.5
# The inverse kinematics makes at most so many moves from one sample to the next.
_MOST_MOVES = 6


@dataclass(eq=False)
class _Walkers:
    """Configurations on their way to their next sample.

    Which of the given ones they are, the sample, and how often they moved towards it; where
    they are, where they were at the sample before, and how they came there, (n, B); and which
    joints are free.
    """

    which: IntArray
    target: IntArray
    moves: IntArray
    point: FloatArray
    now: FloatArray
    step: FloatArray
    free: BoolArray

    def chosen(self, mask: BoolArray) -> _Walkers:
        """Return some of them, each row one piece of memory, which an index would not give."""
        parts = (getattr(self, field.name) for field in fields(self))
        return _Walkers(*(np.compress(mask, part, axis=-1) for part in parts))


def follow(
    chain: Chain,
    q: FloatArray,
    poses: Poses,
    first: int,
    *,
    step: int = 1,
    joint: IntArray | None = None,
    centre: float = 0.0,
) -> tuple[FloatArray, IntArray]:
    """Follow the path from one sample to its end (step 1), or back to its start (-1).

    A joint may be locked for each configuration (n, B). Returns configurations of shape
    (N, n, B), NaN where a pose was not reached, and the last sample that each reached.
    """
    track = np.full((len(poses), *q.shape), np.nan)
    track[first] = q
    last = np.full(q.shape[1], first)
    starts = last.copy()
    for which, samples, reached in march(chain, q, poses, starts, step, joint, centre):
        track[samples, :, which] = reached.T
        last[which] = samples
    return track, last


def march(
    chain: Chain,
    q: FloatArray,
    poses: Poses,
    first: IntArray,
    step: int = 1,
    joint: IntArray | None = None,
    centre: float = 0.0,
    allowed: Allowed | None = None,
) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
    """Follow the path with configurations (n, B), each from its own sample.

    A joint may be locked for each. The first move to a sample goes a share, `centre`, of the
    way towards the middle of the joints' ranges along the self-motion. Ways from sample to
    sample may be restricted to those that are allowed. Yields which
    configurations reached which samples, shape (k,) each, and where they are then, (n, k).
    """
    begin = np.flatnonzero((first + step >= 0) & (first + step < len(poses)))
    point, none = np.take(q, begin, axis=1), np.full((len(q), len(begin)), np.nan)
    free = np.ones(point.shape, dtype=bool)
    if joint is not None:
        free[joint[begin], np.arange(len(begin))] = False
    moves = np.zeros(len(begin), dtype=int)
    target = first[begin] + step
    walkers = _Walkers(begin, target, moves, point, point, none, free)
    middle, ranged = chain.mid_range[:, None], np.isfinite(chain.upper - chain.lower)
    # Joints that move by 1 in all bend the way of a pose by at most this: half the second
    # derivative.
    curved = max(1.0, chain.normal_form.reach) / 2
    while walkers.which.size:
        here, tries = walkers.point, walkers.moves
        position, rotation, matrix = chain.forward(here, poses.rows)
        missing = poses.at(walkers.target).missing(position, rotation)
        there = np.max(np.abs(missing), axis=0) < TOLERANCE_M_OR_RAD
        lower = np.where(walkers.free, chain.lower, here)
        upper = np.where(walkers.free, chain.upper, here)
        drift = None
        if centre:
            there &= tries > 0
            drift = centre * (middle - here) * ranged * walkers.free
            drift *= tries == 0
        damping = LEAST_DAMPING + DAMPING_SHARE * np.sum(missing**2, axis=0)
        move = bounded_step(matrix, missing, damping, here, lower, upper, drift)
        moved = np.clip(here + shortened(move), lower, upper)
        move = moved - here
        left = np.max(np.abs(missing - np.einsum("inb,nb->ib", matrix, move)), axis=0)
        surely = left + curved * np.sum(np.abs(move), axis=0) ** 2 < TOLERANCE_M_OR_RAD / 2
        arrived = there | (surely & (tries < _MOST_MOVES))
        walkers.point = np.where(there, here, moved)
        walkers.moves = tries + 1
        reached = arrived & (np.max(np.abs(walkers.point - walkers.now), axis=0) < JUMP)
        if allowed is not None:
            reached[reached] = allowed(walkers.now[:, reached], walkers.point[:, reached])
        yield walkers.which[reached], walkers.target[reached], walkers.point[:, reached]
        going = reached | (~arrived & (tries < _MOST_MOVES))
        _on(walkers, reached, step, chain, extrapolate=not centre)
        going &= (walkers.target >= 0) & (walkers.target < len(poses))
        if not going.all():
            walkers = walkers.chosen(going)


def _on(
    walkers: _Walkers, reached: BoolArray, step: int, chain: Chain, extrapolate: bool
) -> None:
    """Send those that have reached their sample to the next, on as they went before."""
    if not reached.any():
        return
    point = walkers.point[:, reached]
    move, before = point - walkers.now[:, reached], walkers.step[:, reached]
    walkers.now = np.where(reached, walkers.point, walkers.now)
    walkers.step[:, reached] = move
    walkers.target[reached] += step
    walkers.moves[reached] = 0
    if extrapolate:
        guess = point + move + np.where(np.isnan(before), 0.0, move - before)
        walkers.point[:, reached] = np.clip(guess, chain.lower, chain.upper)
