"""Rotations of unit revolute joints, and the Jacobians that they make.

A unit revolute joint, eq. (21), is a rotation R, shape (3, 3), that takes the axes x, y, z to
v, ω and v × ω. The column of the Jacobian is (v; ω): linear rows first, then rotational ones,
both of length 1 and without a unit.
"""

import numpy as np

from lockedjoint.nlp.arrays import FloatArray


def random_rotations(
    rng: np.random.Generator, count: int, joints: int, *, extended: bool = False
) -> FloatArray:
    """Return uniform rotations, shape (count, joints, 3, 3).

    They are made from quaternions of four normal numbers, whose length does not matter.
    `extended` makes the same rotations in extended precision, from the same quaternions.
    """
    quaternions = rng.standard_normal((count, joints, 4))
    if extended:
        quaternions = quaternions.astype(np.longdouble)
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    matrices = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.asarray(matrices / np.sum(quaternions**2, axis=-1)[..., None, None])


def jacobians_of(rotations: FloatArray) -> FloatArray:
    """Return the Jacobians with columns (v; ω), shape (…, 6, n), of rotations (…, n, 3, 3)."""
    columns = np.concatenate([rotations[..., 0], rotations[..., 1]], axis=-1)
    return np.asarray(np.swapaxes(columns, -1, -2))


def residual_values(rotations: FloatArray) -> FloatArray:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F², (configurations,), at (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    gram = jacobians @ jacobians.swapaxes(-1, -2)
    # n·I is exact, and one division is in the precision of the rotations.
    defect = gram - jacobians.shape[-1] * np.eye(6, dtype=gram.dtype) / 3
    return np.asarray(0.5 * np.sum(defect**2, axis=(-1, -2)))
