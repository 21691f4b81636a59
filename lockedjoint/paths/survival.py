"""Which joints of a robot may lock along a path: a test by following the rest of it.

The test knows nothing of how a trajectory was found. For a joint f and a sample k it locks
joint f at its value there and follows the rest of the path, sample by sample, with the other
joints: damped least squares, within their limits, without a jump from one solution to another.
Where the arm keeps self-motion after the failure, it may first move along that, and starts
again from several of its points. After a failure there is no limit of time: the arm slows
down as it has to.

Arrays of configurations have the shape (n, B), n joints in rad or m, and B configurations. A
path has N samples.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.following import JUMP, Allowed, march
from lockedjoint.paths.waypoints import Poses

# An arm that keeps self-motion when a joint locks tries again from so many other points of it.
_MOST_RESTARTS = 4
# Length of a step of an arm along its self-motion before it tries again.
_PUSH_M_OR_RAD = 0.25
# Least number of such steps, drawn at random for each attempt.
_LEAST_PUSHES = 2
# Largest number of such steps.
_MOST_PUSHES = 8
#: Share of the way to the middle of the joints' ranges by which an arm that keeps self-motion
#: moves at each sample, so that limits come later.
CENTRE_SHARE = 0.1


def survivors(
    chain: Chain,
    nodes: FloatArray,
    samples: IntArray,
    poses: Poses,
    seed: int = 0,
    allowed: Allowed | None = None,
    tracks: FloatArray | None = None,
) -> IntArray:
    """Lock each joint at each of many configurations and finish the path.

    Returns the last sample that is reached after joint f locks, shape (n, B). `nodes` holds the
    configurations, (n, B), and `samples` the sample of each, (B,). The seed is of the points of
    the self-motion from which it is tried again. What is allowed is which ways may be gone.
    Configurations that finish the path go into the tracks, (n, B, N, n), if given: the first is
    where it was tried from.
    """
    size, count = nodes.shape
    redundant = size - 1 > len(poses.rows)
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
        steps = march(
            chain,
            q,
            poses,
            first=start,
            joint=joint,
            centre=CENTRE_SHARE if redundant else 0.0,
            allowed=allowed,
        )
        for alive, reached, there in steps:
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
    push *= _PUSH_M_OR_RAD / np.sqrt(np.sum(push**2, axis=0))
    for _ in range(int(rng.integers(_LEAST_PUSHES, _MOST_PUSHES + 1))):
        shifted = np.clip(q + push * free, chain.lower, chain.upper)
        moved, reached = solve_ik(chain, shifted, target, free)
        reached &= np.max(np.abs(moved - q), axis=0) < JUMP
        if allowed is not None:
            reached[reached] = allowed(q[:, reached], moved[:, reached])
        q = np.where(reached, moved, q)
    return q
