"""Which joints of a robot may lock along a path: a test in NumPy, many configurations at once.

The test knows nothing of how a trajectory was found. For a joint f and a sample k it locks
joint f at its value there and follows the rest of the path, sample by sample, with the other
joints: damped least squares, within their limits, without a jump from one solution to another.
Where the arm keeps self-motion after the failure, it may first move along that, and starts
again from several of its points. After a failure there is no limit of time: the arm slows
down as it has to.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.inverse import solve_ik
from formulations.kinematics.link_chain import IntArray
from formulations.paths.waypoints import Poses
from nlp.arrays import FloatArray

# A joint that moves further between two samples has jumped to another solution, or the arm
# passes a singularity: radians or metres.
JUMP = 0.5
# Configurations done together: what fits into a processor's cache.
_CHUNK = 3000
# Where the locked arm keeps self-motion: from how many other points of it to try again.
_RESTARTS = 4


def follow(
    kinematics: Kinematics,
    q: FloatArray,
    poses: Poses,
    first: int,
    *,
    step: int = 1,
    joint: IntArray | None = None,
    centre: float = 0.0,
) -> tuple[FloatArray, IntArray]:
    """Follow the path from one sample to its end, or backwards to its start.

    Parameters
    ----------
    kinematics
        The arm.
    q
        Configurations at the first sample, shape (n, B).
    poses
        The path.
    first
        The sample where they start.
    step
        1 to the end, -1 to the start.
    joint
        The joint of each that is locked, shape (B,); none if left out.
    centre
        See `solve_ik`.

    Returns
    -------
    numpy.ndarray
        Configurations, shape (N, n, B), NaN where a pose was not reached.
    numpy.ndarray
        The last sample that each reached, shape (B,).
    """
    track = np.full((len(poses), *q.shape), np.nan)
    track[first] = q
    last = np.full(q.shape[1], first)
    for sample, which, reached in _march(
        kinematics, q, poses, last.copy(), step, joint, centre
    ):
        track[sample][:, which] = reached
        last[which] = sample
    return track, last


def survivors(
    kinematics: Kinematics, nodes: FloatArray, samples: IntArray, poses: Poses, seed: int = 0
) -> IntArray:
    """Lock each joint at each of many configurations and finish the path.

    Parameters
    ----------
    kinematics
        The arm.
    nodes
        Configurations on the path, shape (n, B).
    samples
        The sample of the path that each is at, shape (B,).
    poses
        The path.
    seed
        Of the points of the self-motion from which it is tried again.

    Returns
    -------
    numpy.ndarray
        The last sample that is reached after joint f locks, shape (n, B); the path is
        finished if it is ``len(poses) - 1``.
    """
    size, count = nodes.shape
    redundant = size - 1 > len(kinematics.rows)
    # Towards the middle of the ranges, where the arm still can: limits then come later.
    centre = 0.1 if redundant else 0.0
    locked, which = np.mgrid[:size, :count].reshape(2, -1)
    first: IntArray = samples[which]
    last, rng = first.copy(), np.random.default_rng(seed)
    pairs = np.arange(len(last))
    for attempt in range(1 + (_RESTARTS if redundant else 0)):
        order = pairs[np.argsort(first[pairs], kind="stable")]
        # Samples of a chunk are near each other.
        for chunk in np.array_split(order, max(1, -(-len(order) // _CHUNK))):
            q, joint, start = nodes[:, which[chunk]], locked[chunk], first[chunk]
            if attempt:
                q = _elsewhere(kinematics, q, joint, start, poses, rng)
            for sample, alive, _ in _march(kinematics, q, poses, start, 1, joint, centre):
                last[chunk[alive]] = np.maximum(last[chunk[alive]], sample)
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


def _march(
    kinematics: Kinematics,
    q: FloatArray,
    poses: Poses,
    first: IntArray,
    step: int,
    joint: IntArray | None,
    centre: float,
) -> Iterator[tuple[int, IntArray, FloatArray]]:
    """Follow the path, each configuration from its own sample.

    Yields sample after sample, with which configurations reached it, and where they are.
    """
    free = None if joint is None else np.arange(len(q))[:, None] != joint
    now, before = q.copy(), q.copy()
    alive = np.ones(q.shape[1], dtype=bool)
    outset = int(first.min(initial=len(poses)) if step > 0 else first.max(initial=0))
    for sample in range(outset + step, len(poses) if step > 0 else -1, step):
        active = np.flatnonzero(alive & (step * first < step * sample))
        if not active.size:
            continue
        here = now[:, active]
        # On as it went from the sample before, unless the first step goes to mid-range.
        guess = 2 * here - before[:, active]
        guess = here if centre else np.clip(guess, kinematics.lower, kinematics.upper)
        mask = None if free is None else free[:, active]
        there, reached = solve_ik(kinematics, guess, *poses.at(sample), mask, centre=centre)
        reached &= np.max(np.abs(there - here), axis=0) < JUMP
        before[:, active], now[:, active] = here, there
        alive[active] = reached
        yield sample, active[reached], there[:, reached]
        if not alive.any():
            return


def _elsewhere(
    kinematics: Kinematics,
    q: FloatArray,
    joint: IntArray,
    samples: IntArray,
    poses: Poses,
    rng: np.random.Generator,
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
        q = np.where(reached, moved, q)
    return q
