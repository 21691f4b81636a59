"""Configurations made without the code under test, and one small program to solve."""

import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

Floats = NDArray[np.float64]
ATTAINED = Path(__file__).parents[3] / "results" / "comparison" / "jacobians.json"


@pytest.fixture(autouse=True, scope="package")
def one_blas_thread():
    """Many small matrices: with busy cores a second thread costs ten times what it saves."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


def haar_rotations(seed, count, joints):
    """Return uniform rotations by QR, (count, joints, 3, 3)."""
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.standard_normal((count, joints, 3, 3)))
    q = q * np.sign(np.diagonal(r, axis1=-2, axis2=-1))[..., None, :]
    return q * np.linalg.det(q)[..., None, None]


def jacobian(rotations):
    """Return J, (…, 6, n), with columns (v; ω)."""
    return np.concatenate([rotations[..., 0], rotations[..., 1]], axis=-1).swapaxes(-1, -2)


def residual(rotations):
    j = jacobian(rotations)
    gram = j @ j.swapaxes(-1, -2) - j.shape[-1] / 3 * np.eye(6)
    return 0.5 * np.sum(gram**2, axis=(-1, -2))


def worst_case(rotations):
    """Return the squared worst case of one configuration, (n, 3, 3), by SVD."""
    kept = (np.delete(jacobian(rotations), f, axis=1) for f in range(len(rotations)))
    return min(float(np.linalg.svd(j, compute_uv=False)[-1]) for j in kept) ** 2


def moved(rotations, seed, signs=True):
    """Apply a random element of every symmetry, or all but signs of single columns."""
    rng = np.random.default_rng(seed)
    joints = len(rotations)
    angle = rng.uniform(0, 2 * np.pi)
    cos, sin = np.cos(angle), np.sin(angle)
    phase = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    frame = haar_rotations(seed + 1, 1, 1)[0, 0]
    image = frame @ rotations[rng.permutation(joints)] @ phase @ np.diag([1.0, -1.0, -1.0])
    signs = rng.choice([-1.0, 1.0], joints if signs else 1) * np.ones(joints)
    scale = np.stack([signs, signs, np.ones(joints)], axis=-1)
    return image * scale[:, None, :]


@pytest.fixture(scope="session")
def so3():
    """Hand the functions of this file to the tests."""
    return SimpleNamespace(
        haar_rotations=haar_rotations,
        jacobian=jacobian,
        residual=residual,
        moved=moved,
        worst_case=worst_case,
    )


@pytest.fixture(scope="session")
def plain():
    """Hand over the second way to evaluate blocks, `plain_average`."""
    path = Path(__file__).with_name("plain_average.py")
    spec = spec_from_file_location("plain_average", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def attained():
    """Return the rotations of the best known 7R and its squared worst case, by SVD."""
    records = json.loads(ATTAINED.read_text(encoding="utf-8"))
    found = []
    for record in records:
        if (record["formulation"], record["model"]) == ("max-min", "unit-revolute"):
            v, omega = np.split(np.array(record["jacobian"]).T, 2, axis=1)
            found.append(np.stack([v, omega, np.cross(v, omega)], axis=-1))
    best = max(found, key=worst_case)
    return best[None], worst_case(best)
