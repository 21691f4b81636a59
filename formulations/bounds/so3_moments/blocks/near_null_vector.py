"""Configurations for sampling where s = Σ j_f is small, and the units that they give to blocks.

Where a worst case near the best is reached, s and ρ are small. There, functions that are of
size 1 on the average over all configurations take tiny values, and pseudo-moments in units of
that average are huge. Samples that concentrate where s and ρ are small give units in which all
numbers of the program have ordinary sizes.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from formulations.bounds.so3_moments.relaxation import residual_values
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from nlp.arrays import FloatArray

_STEP = 0.06
_MOST_STEPS = 1500
#: |s|² and ρ from which on the weight of a sample falls.
_NEAR, _LOW, _WIDTH = 0.05, 0.6, 0.3
_RELATIVE_RANK = 1e-9


def concentrated_rotations(rng: np.random.Generator, count: int, joints: int) -> FloatArray:
    """Return rotations (count, joints, 3, 3): every fourth uniform, the others with small s.

    These follow −∇(½|s|² + bρ) with random b for a random number of steps, and are moved by a
    random angle then, so that they are spread over all distances from s = 0.
    """
    found = random_rotations(rng, count, joints)
    share = np.exp(rng.uniform(np.log(0.01), np.log(0.4), (count, 1, 1)))
    steps = np.exp(rng.uniform(0, np.log(_MOST_STEPS), count)).astype(int)
    steps[::4] = 0
    angles = np.exp(rng.uniform(np.log(0.005), np.log(0.15), (count, 1, 1)))
    angles[::4] = 0
    moving = found.copy()
    for number in range(1, int(steps.max()) + 1):
        left = np.flatnonzero(steps >= number)
        turns = -_STEP / (1 + 3 * share[left]) * _torques(moving[left], share[left])
        moving[left] = _turned(moving[left], turns)
    return _turned(moving, angles * rng.standard_normal((count, joints, 3)))


def concentrating_weights(rotations: FloatArray) -> FloatArray:
    """Return weights of configurations (count, n, 3, 3) that fall where s or ρ are large."""
    total = jacobians_of(rotations).sum(axis=2)
    far = np.sum(total**2, axis=1) / _NEAR
    high = np.maximum(residual_values(rotations) - _LOW, 0) / _WIDTH
    return np.asarray(1 / (1 + (far + high) ** 1.5))


def units(block: FloatArray, weights: FloatArray, *, semidefinite: bool) -> FloatArray:
    """Return T such that TᵀCT is the unit matrix, C the weighted mean of |B|.

    Parameters
    ----------
    block
        B at samples, (samples, size, size).
    weights
        Of the samples.
    semidefinite
        Whether B ⪰ 0 at all of them, so that |B| = B; else |B| has the absolute values of the
        eigenvalues.

    Returns
    -------
    numpy.ndarray
        Shape (size, size'). Vectors along which B vanishes are left out.
    """
    sizes = block
    if not semidefinite:
        values, vectors = np.linalg.eigh(block)
        sizes = (vectors * np.abs(values)[:, None, :]) @ vectors.swapaxes(1, 2)
    mean = np.tensordot(weights / weights.sum(), sizes, axes=1)
    values, vectors = np.linalg.eigh(0.5 * (mean + mean.T))
    kept = values > _RELATIVE_RANK * values[-1]
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))


def _torques(rotations: FloatArray, share: FloatArray) -> FloatArray:
    """Return the gradient of ½|s|² + bρ for turns of each joint, (count, n, 3)."""
    jacobians = jacobians_of(rotations)
    joints = jacobians.shape[2]
    defect = jacobians @ jacobians.swapaxes(1, 2) - joints / 3 * np.eye(6)
    slopes = jacobians.sum(axis=2, keepdims=True) + 2 * share * (defect @ jacobians)
    slopes = slopes.swapaxes(1, 2)
    linear = np.cross(rotations[..., 0], slopes[..., :3])
    return np.asarray(linear + np.cross(rotations[..., 1], slopes[..., 3:]))


def _turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()
    return np.asarray(turns.reshape(rotations.shape) @ rotations)


def transformed(
    multipliers: Sequence[FloatArray], transforms: Sequence[FloatArray]
) -> tuple[FloatArray, ...]:
    """Return TXTᵀ, the multipliers of B, from those X of TᵀBT."""
    return tuple(t @ x @ t.T for x, t in zip(multipliers, transforms, strict=True))
