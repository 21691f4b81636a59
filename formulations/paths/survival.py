"""Which joints of a robot may lock along a path: a test in NumPy, many configurations at once.

The test knows nothing of how a trajectory was found. For a joint f and a sample k it holds
joint f at its value there and follows the rest of the path, sample by sample, with the other
joints: damped least squares, within their limits, without a jump from one solution to another.
Where the arm keeps self-motion after the failure, it may first move along that, and starts
again from several of its points. After a failure there is no limit of time: the arm slows
down as it has to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formulations.kinematics.forward import BoolArray, Kinematics
from nlp.arrays import FloatArray

# A joint that moves further between two samples has jumped to another solution, or the arm
# passes a singularity: radians or metres.
JUMP = 0.5
# Configurations done together: what fits into a processor's cache.
_CHUNK = 3000


@dataclass(frozen=True, eq=False)
class Poses:
    """The samples of a path: positions (N, 3) and rotations (N, 3, 3)."""

    positions: FloatArray
    rotations: FloatArray

    def __len__(self) -> int:
        return len(self.positions)

    def at(self, sample: int) -> tuple[FloatArray, FloatArray]:
        """Return one pose as `Kinematics` takes it."""
        return self.positions[sample][:, None], self.rotations[sample][:, :, None]


def follow(
    kinematics: Kinematics,
    q: FloatArray,
    poses: Poses,
    first: int,
    *,
    step: int = 1,
    joint: npt.NDArray[np.intp] | None = None,
    centre: float = 0.0,
) -> tuple[FloatArray, npt.NDArray[np.intp]]:
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
        See `Kinematics.reach`.

    Returns
    -------
    numpy.ndarray
        Configurations, shape (N, n, B), NaN where a pose was not reached.
    numpy.ndarray
        The last sample that each reached, shape (B,).
    """
    count = q.shape[1]
    track = np.full((len(poses), *q.shape), np.nan)
    track[first] = q
    last = np.full(count, first)
    free = None if joint is None else np.arange(len(q))[:, None] != joint
    before, now, alive = q, q, np.arange(count)
    end = len(poses) if step > 0 else -1
    for sample in range(first + step, end, step):
        mask = None if free is None else free[:, alive]
        moved, alive_now = _advance(kinematics, before, now, poses.at(sample), mask, centre)
        before, now, alive = now[:, alive_now], moved[:, alive_now], alive[alive_now]
        if not alive.size:
            break
        track[sample][:, alive] = now
        last[alive] = sample
    return track, last


def _advance(
    kinematics: Kinematics,
    before: FloatArray,
    now: FloatArray,
    pose: tuple[FloatArray, FloatArray],
    free: BoolArray | None,
    centre: float,
) -> tuple[FloatArray, BoolArray]:
    """Go on by one sample; `before` is the configuration one sample earlier."""
    guess = now if centre else np.clip(2 * now - before, kinematics.lower, kinematics.upper)
    moved, reached = kinematics.reach(guess, *pose, free, centre=centre)
    return moved, reached & (np.max(np.abs(moved - now), axis=0) < JUMP)


def survivors(
    kinematics: Kinematics,
    nodes: FloatArray,
    samples: npt.NDArray[np.intp],
    poses: Poses,
    restarts: int = 4,
    seed: int = 0,
) -> npt.NDArray[np.intp]:
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
    restarts
        Where the locked arm keeps self-motion: from how many other points of it to try again.
    seed
        Of those points.

    Returns
    -------
    numpy.ndarray
        The last sample that is reached after joint f locks, shape (n, B); the path is
        finished if it is ``len(poses) - 1``.
    """
    size, count = nodes.shape
    redundant = size - 1 > len(kinematics.rows)
    locked, which = (one.ravel() for one in np.mgrid[:size, :count])
    last = np.empty(size * count, dtype=np.intp)
    for chunk in _chunks(samples[which]):
        q, joint = nodes[:, which[chunk]], locked[chunk]
        last[chunk] = _finish(kinematics, q, joint, samples[which[chunk]], poses, redundant)
    rng = np.random.default_rng(seed)
    for _ in range(restarts if redundant else 0):
        failed = np.flatnonzero(last < len(poses) - 1)
        if not failed.size:
            break
        for chunk in _chunks(samples[which[failed]]):
            part = failed[chunk]
            q, joint, start = nodes[:, which[part]], locked[part], samples[which[part]]
            q = _elsewhere(kinematics, q, joint, start, poses, rng)
            ended = _finish(kinematics, q, joint, start, poses, redundant)
            last[part] = np.maximum(last[part], ended)
    return last.reshape(size, count)


def _chunks(samples: npt.NDArray[np.intp]) -> list[npt.NDArray[np.intp]]:
    """Split into parts whose samples are near each other."""
    order = np.argsort(samples, kind="stable")
    return np.array_split(order, max(1, -(-len(order) // _CHUNK)))


def _finish(
    kinematics: Kinematics,
    q: FloatArray,
    joint: npt.NDArray[np.intp],
    samples: npt.NDArray[np.intp],
    poses: Poses,
    redundant: bool,
) -> npt.NDArray[np.intp]:
    """Follow the rest of the path, each from its own sample; return the last one reached."""
    last = samples.copy()
    free = np.arange(len(q))[:, None] != joint
    now, before = q.copy(), q.copy()
    alive = np.ones(q.shape[1], dtype=bool)
    # Towards the middle of the ranges, where the arm still can: limits then come later.
    centre = 0.1 if redundant else 0.0
    for sample in range(int(samples.min(initial=len(poses))) + 1, len(poses)):
        active = np.flatnonzero(alive & (samples < sample))
        if not active.size:
            continue
        moved, going = _advance(
            *(kinematics, before[:, active], now[:, active], poses.at(sample)),
            *(free[:, active], centre),
        )
        before[:, active] = now[:, active]
        now[:, active] = moved
        alive[active] = going
        last[active[going]] = sample
    return last


def _elsewhere(
    kinematics: Kinematics,
    q: FloatArray,
    joint: npt.NDArray[np.intp],
    samples: npt.NDArray[np.intp],
    poses: Poses,
    rng: np.random.Generator,
) -> FloatArray:
    """Move along the self-motion that the locked arm keeps, in steps at the same pose."""
    free = np.arange(len(q))[:, None] != joint
    position = poses.positions[samples].T
    rotation = np.moveaxis(poses.rotations[samples], 0, 2)
    push = rng.normal(size=q.shape)
    push *= 0.25 / np.sqrt(np.sum(push**2, axis=0))
    for _ in range(int(rng.integers(2, 9))):
        shifted = np.clip(q + push * free, kinematics.lower, kinematics.upper)
        moved, reached = kinematics.reach(shifted, position, rotation, free)
        reached &= np.max(np.abs(moved - q), axis=0) < JUMP
        q = np.where(reached, moved, q)
    return q


def on_path(
    kinematics: Kinematics, poses: Poses, sample: int, starts: int, rng: np.random.Generator
) -> FloatArray:
    """Return configurations at a pose, within the limits, from random starts; shape (n, B)."""
    least, largest = kinematics.ranges
    drawn = rng.uniform(least, largest, (len(least), starts))
    q, reached = kinematics.reach(drawn, *poses.at(sample), iterations=60)
    return q[:, reached]
