"""Samples for the search for the worst case, and the units of blocks that they give.

Samples concentrate where s = Σ j_f and ρ = ½‖E‖_F² are small, with E = JJᵀ − (n/3)I. They
follow the direction of steepest descent of ½|s|² + bρ, where b is a random weight of ρ for each
sample. The means over the samples give units in which all numbers of the program have ordinary
sizes (docs/bounds.md, section 4). The first two columns of a rotation are v and ω.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.formulations.bounds.moments.rotations import (
    jacobians_of,
    random_rotations,
    residual_values,
)
from lockedjoint.nlp.arrays import FloatArray

# A step of steepest descent of ½|s|² + bρ turns joints by this number, divided by 1 + 3b, times
# the gradient: radians for a gradient of size 1. With a larger b the function is steeper, so
# the division makes the step shorter.
_STEP = 0.06
# Largest number of such steps. The constants of this file decide where samples are, and so how
# many digits the solver keeps; no bound depends on them.
_MOST_STEPS = 1500
# One sample in so many stays uniform.
_UNIFORM_EVERY = 4
# Least weight b of ρ.
_LEAST_RESIDUAL_WEIGHT = 0.01
# Largest weight b of ρ.
_LARGEST_RESIDUAL_WEIGHT = 0.4
# Least size of the random turn of a joint after the steps.
_LEAST_TURN_RAD = 0.005
# Largest size of that turn.
_LARGEST_TURN_RAD = 0.15
# Power of the distance with which weights fall.
_FALL = 1.5
# |s|² at which the weight of a sample has halved; the weight falls from |s|² = 0 on.
_NEAR = 0.05
# ρ from which on the weight of a sample falls.
_LOW = 0.6
# The ρ beyond that after which the weight has halved.
_WIDTH = 0.3
# Eigenvalue of the weighted mean of a block, relative to the largest, that counts as 0.
_RELATIVE_RANK = 1e-9


def concentrated_rotations(rng: np.random.Generator, count: int, joints: int) -> FloatArray:
    """Return rotations, shape (count, joints, 3, 3): every fourth uniform, others with small s.

    The others follow −∇(½|s|² + bρ) for random numbers of steps, and turn at random then.
    Weights b, numbers of steps and sizes of turns have logarithms that are uniform.
    """
    found = random_rotations(rng, count, joints)
    residual_weight = np.exp(
        rng.uniform(
            np.log(_LEAST_RESIDUAL_WEIGHT), np.log(_LARGEST_RESIDUAL_WEIGHT), (count, 1, 1)
        )
    )
    steps = np.exp(rng.uniform(0, np.log(_MOST_STEPS), count)).astype(int)
    steps[::_UNIFORM_EVERY] = 0
    angles = np.exp(
        rng.uniform(np.log(_LEAST_TURN_RAD), np.log(_LARGEST_TURN_RAD), (count, 1, 1))
    )
    angles[::_UNIFORM_EVERY] = 0
    moving = found.copy()
    for number in range(1, int(steps.max()) + 1):
        left = np.flatnonzero(steps >= number)
        torques = _torques(moving[left], residual_weight[left])
        turns = -_STEP / (1 + 3 * residual_weight[left]) * torques
        moving[left] = _turned(moving[left], turns)
    return _turned(moving, angles * rng.standard_normal((count, joints, 3)))


def concentrating_weights(rotations: FloatArray) -> FloatArray:
    """Return weights, shape (count,), at most 1, that fall where s or ρ are large.

    Parameters
    ----------
    rotations
        The configurations, shape (count, n, 3, 3).
    """
    total = jacobians_of(rotations).sum(axis=2)
    far = np.sum(total**2, axis=1) / _NEAR
    high = np.maximum(residual_values(rotations) - _LOW, 0) / _WIDTH
    return np.asarray(1 / (1 + (far + high) ** _FALL))


def absolute_values(block: FloatArray) -> FloatArray:
    """Return |B|, which has the absolute values of the eigenvalues of B.

    B and |B| have the shape (count, size, size).
    """
    values, vectors = np.linalg.eigh(block)
    return np.asarray((vectors * np.abs(values)[:, None, :]) @ vectors.swapaxes(1, 2))


def units_of_block(absolute: FloatArray, weights: FloatArray) -> FloatArray:
    """Return T with TᵀCT = I, C the weighted mean of |B|, without what vanishes.

    Parameters
    ----------
    absolute
        |B| at configurations, shape (count, size, size).
    weights
        Weights of the configurations, shape (count,).

    Returns
    -------
    FloatArray
        T, shape (size, rank of C).
    """
    mean = np.tensordot(weights / weights.sum(), absolute, axes=1)
    values, vectors = np.linalg.eigh(0.5 * (mean + mean.T))
    kept = values > _RELATIVE_RANK * values[-1]
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))


def _torques(rotations: FloatArray, residual_weight: FloatArray) -> FloatArray:
    """Return the gradient of ½|s|² + bρ for turns of each joint, shape (count, n, 3).

    `residual_weight` is b, shape (count, 1, 1).
    """
    jacobians = jacobians_of(rotations)
    joints = jacobians.shape[2]
    # E of each configuration. The gradient of ½|s|² in a column is s, and that of ρ is 2E j.
    defect = jacobians @ jacobians.swapaxes(1, 2) - joints / 3 * np.eye(6)
    slopes = jacobians.sum(axis=2, keepdims=True) + 2 * residual_weight * (defect @ jacobians)
    slopes = slopes.swapaxes(1, 2)
    linear = np.cross(rotations[..., 0], slopes[..., :3])
    return np.asarray(linear + np.cross(rotations[..., 1], slopes[..., 3:]))


def _turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return rotations, (count, n, 3, 3), after turns by rotation vectors, (count, n, 3)."""
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()
    return np.asarray(turns.reshape(rotations.shape) @ rotations)
