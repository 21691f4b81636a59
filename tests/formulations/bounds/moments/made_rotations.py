"""Rotations, and what follows from them, without the code under test."""

import numpy as np


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
