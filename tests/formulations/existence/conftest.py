"""What several tests of the proof need: its certificate, and true solutions.

The true solutions of the equations are made without the code under test.
"""

from pathlib import Path

import numpy as np
import pytest

COMMITTED = Path(__file__).parents[3] / "results" / "existence" / "certificate.json"


@pytest.fixture(scope="session")
def committed():
    return COMMITTED


def polar(matrices):
    """Return the nearest matrices with orthonormal columns (or rows)."""
    u, _, vt = np.linalg.svd(matrices, full_matrices=False)
    return u @ vt


def w_of(jacobian):
    """Return W = ZᵀZ for Z = V + iΩ, with the upper half of the rows V and the lower half Ω."""
    half = len(jacobian) // 2
    z = jacobian[:half] + 1j * jacobian[half:]
    return z.T @ z


def isotropic_6r(seed):
    """Return an orthogonal 6×6 matrix whose columns are unit revolute joints over √2.

    Alternating projections between JJᵀ = 2I and |v| = |ω| = 1, v·ω = 0.
    """
    jacobian = np.random.default_rng(seed).standard_normal((6, 6))
    for _ in range(5000):
        isotropic = np.sqrt(2) * polar(jacobian)
        joints = polar(np.stack([isotropic[:3].T, isotropic[3:].T], axis=-1))
        jacobian = np.concatenate([joints[..., 0].T, joints[..., 1].T])
        if np.abs(jacobian - isotropic).max() < 1e-14:
            return jacobian / np.sqrt(2)
    raise AssertionError("alternating projections did not converge")


def rotated_simplex(seed):
    """Return a turned regular simplex: 6×7, orthonormal rows, equal columns."""
    rng = np.random.default_rng(seed)
    square = np.column_stack([np.ones(7), rng.standard_normal((7, 6))])
    rows = np.linalg.qr(square)[0][:, 1:].T
    return np.linalg.qr(rng.standard_normal((6, 6)))[0] @ rows


@pytest.fixture(scope="session")
def solution_6r():
    return lambda seed: w_of(isotropic_6r(seed))


@pytest.fixture(scope="session")
def solution_simplex():
    return lambda seed: w_of(rotated_simplex(seed))


@pytest.fixture(scope="session")
def printed_6r():
    """Return W of an isotropic 6R Jacobian with joints along the axes, free of rounding."""
    v, omega = np.zeros((3, 6)), np.zeros((3, 6))
    for axis in range(3):
        for place, sign in enumerate((1.0, -1.0)):
            v[axis, 2 * axis + place] = 1.0
            omega[(axis + 1) % 3, 2 * axis + place] = sign
    return w_of(np.vstack([v, omega]) / np.sqrt(2))
