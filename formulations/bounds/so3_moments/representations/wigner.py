"""Wigner functions of a joint: the matrices D^l of the rotation (v, ω, v × ω).

A unit revolute joint, eq. (21), is a rotation R that takes the axes x, y, z to v, ω and v × ω.
D^l is its matrix on spin l, components from −l to l. The first index belongs to the frame, the
second, m, to the phase (v + iω → e^{−iθ}(v + iω) multiplies D^l_{Mm} by e^{−imθ}).
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats, coupling

# Columns: the spherical unit vectors e_{−1}, e_0, e_{+1}.
SPHERICAL = np.array(
    [[1 / sqrt(2), 0, -1 / sqrt(2)], [-1j / sqrt(2), 0, -1j / sqrt(2)], [0, 1, 0]]
)


def random_rotations(rng: np.random.Generator, count: int, joints: int) -> Floats:
    """Return uniformly distributed rotation matrices, shape (count, joints, 3, 3)."""
    return rotations_of(rng.standard_normal((count, joints, 4)))


def rotations_of(quaternions: Floats) -> Floats:
    """Return the rotation matrices of quaternions (w, x, y, z) of any norm but 0."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    matrices = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.asarray(matrices / np.sum(quaternions**2, axis=-1)[..., None, None])


def rotations_of_jacobian(jacobian: Floats) -> Floats:
    """Return the rotations of the columns of a unit revolute Jacobian, shape (n, 3, 3)."""
    v, omega = jacobian[:3].T, jacobian[3:].T
    return np.stack([v, omega, np.cross(v, omega)], axis=-1)


def jacobians_of(rotations: Floats) -> Floats:
    """Return the Jacobians with columns (v; ω), shape (…, 6, n), of rotations (…, n, 3, 3)."""
    columns = np.concatenate([rotations[..., 0], rotations[..., 1]], axis=-1)
    return np.asarray(np.swapaxes(columns, -1, -2))


def wigner_matrices(rotations: Floats, largest: int) -> list[NDArray[np.complex128]]:
    """Return D^0, …, D^largest, each of shape (…, 2l+1, 2l+1), of rotations (…, 3, 3).

    D^{l+1} is cut out of D^l ⊗ D^1 by Clebsch–Gordan coefficients.
    """
    one = SPHERICAL.conj().T @ rotations @ SPHERICAL
    found = [np.ones((*rotations.shape[:-2], 1, 1), dtype=complex), one]
    for spin in range(1, largest):
        size = 3 * (2 * spin + 1)
        cut = coupling(spin, 1, spin + 1).reshape(size, -1)
        products = found[spin][..., :, None, :, None] * one[..., None, :, None, :]
        together = products.reshape(*rotations.shape[:-2], size, size)
        found.append(cut.T @ (together @ cut))
    return found[: largest + 1]
