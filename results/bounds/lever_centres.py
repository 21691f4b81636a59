"""Centres whose balls hold all unit tight frames, and the certificate made of them.

A certificate proves that no isotropic 7R arm has all lever arms within a limit. It holds the
centres only: `lockedjoint verify` proves from them that their balls hold all frames, and that
no frame has an arm. The proofs are in lever_cells.md.
"""

import numpy as np

from lockedjoint.nlp.arrays import FloatArray

#: Distance of Σ ω_iω_iᵀ from (7/3) I up to which random axes are made a tight frame.
NEAR = 0.5
#: Steps of that at most, and the residual at its end.
STEPS = 500
RESIDUAL = 1e-13
#: Orthonormal basis of the symmetric 3×3 matrices of trace 0.
TRACELESS = np.array(
    [
        [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, -2]],
    ]
) / np.sqrt([2, 2, 2, 2, 6]).reshape(5, 1, 1)


def random_frame(rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Return a random unit tight frame W̄ (3,7), and its weight: weighted means are over volume.

    Random axes near a tight frame are made one by alternate projections. The weight is the
    volume by which the map from axes to the traceless part of Σ ω_iω_iᵀ stretches.
    """
    while True:
        axes = rng.normal(size=(3, 7))
        axes /= np.linalg.norm(axes, axis=0)
        if np.linalg.norm(axes @ axes.T - 7 / 3 * np.eye(3)) > NEAR:
            continue
        for _ in range(STEPS):
            left, _, right = np.linalg.svd(axes, full_matrices=False)
            frame = left @ right
            lengths = np.linalg.norm(frame, axis=0)
            if np.abs(lengths**2 - 3 / 7).max() < RESIDUAL:
                return frame, _weight(axes)
            axes = frame / lengths


def _weight(axes: FloatArray) -> float:
    """Return √det DDᵀ, D the derivative of the traceless part of Σ ω_iω_iᵀ along spheres."""
    moves = 2 * TRACELESS @ axes
    moves -= (moves * axes).sum(1, keepdims=True) * axes
    flat = moves.reshape(5, 21)
    return float(np.sqrt(np.linalg.det(flat @ flat.T)))
