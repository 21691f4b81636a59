"""How many cells exclude isotropic lever arms near random unit tight frames, and in what time.

Each cell is excluded by a true bound; the number of cells for all frames is an estimate, from
cubes around random frames. What was found is in isotropic_levers.md, section "True bounds".
"""

import argparse
import time

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.charts import tight_chart
from lockedjoint.formulations.bounds.lever_cells.trees import Census, Nodes, census
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Half side of a cube, as a length of K.
HALF_SIDE = 0.1
#: Length |K| of a corner of the cube, and so of all frames that count, and a little more.
RADIUS = 0.26
#: Volume of the unit tight frames, modulo rotations and orders, in lengths of K; known to 10 %.
VOLUME = 2.6 / (7 / 3) ** 3
#: Distance of Σ ω_iω_iᵀ from (7/3) I up to which random axes are made a tight frame.
NEAR = 0.5
#: Steps of that at most, and the residual at its end.
STEPS = 500
RESIDUAL = 1e-13
#: Seconds after which the rest of a cube is left.
CUBE_SECONDS = 120.0
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


def cubes(limit: float, seconds: float, seed: int) -> tuple[list[Census], FloatArray]:
    """Return what cubes around random frames take, until the seconds are over, and weights."""
    rng, start = np.random.default_rng(seed), time.monotonic()
    found: list[Census] = []
    weights: list[float] = []
    while not found or time.monotonic() - start < seconds:
        frame, weight = random_frame(rng)
        chart = tight_chart(frame, RADIUS**2 / (1 + RADIUS**2))
        found.append(census(chart, limit, Nodes.cube(HALF_SIDE), CUBE_SECONDS))
        weights.append(weight)
    return found, np.array(weights)


def row(limit: float, seconds: float, seed: int) -> str:
    """Return a row of the table for one greatest lever arm."""
    found, weights = cubes(limit, seconds, seed)
    number = VOLUME / (2 * HALF_SIDE) ** 6

    def whole(values: list[float]) -> float:
        """Return the estimate for all frames."""
        return float(number * (weights @ values) / weights.sum())

    certificates = weights * [c.certificates for c in found]
    error = number * np.sqrt((certificates**2).sum()) / weights.sum()
    share = certificates.max() / max(certificates.sum(), 1e-300)
    return (
        f"| {limit:g} | {len(found)} | {whole([c.nodes for c in found]):.1e} "
        f"| {whole([c.certificates for c in found]):.1e} ± {error:.0e} | {share:.2f} "
        f"| {whole([c.programs for c in found]):.1e} "
        f"| {whole([c.seconds for c in found]) / 3600:.2f} h | {sum(c.left for c in found)} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limits", type=float, nargs="+", default=[0.06, 0.0798, 0.09])
    parser.add_argument("--seconds", type=float, default=200.0, help="for each limit")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print("| A | cubes | boxes | certificates | greatest share | programs | one core | left |")
    print("|--:|--:|--:|--:|--:|--:|--:|--:|")
    try:
        for limit in asked.limits:
            print(row(limit, asked.seconds, asked.seed), flush=True)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
