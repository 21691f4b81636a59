"""The paper's Fig. 3: the family (16) of optimal planar 4R manipulators.

Max-min for one locked joint ends anywhere on the family, for two at odd multiples of π/4: each
member that is drawn was solved for, and its α measured.
"""

import numpy as np
import pandas as pd

from formulations import measures
from formulations.plot.figure_1 import angles, draw_on_circle, optima, turned
from formulations.plot.picture import Picture, Request
from formulations.plot.style import INK, SMALL, TITLE, VERMILION, styled
from formulations.synthesis.from_jacobian import realise
from nlp.arrays import FloatArray

WIDTH, HEIGHT = 8.4, 5.6
# Members drawn are those nearest to these, in degrees.
FOR_ONE = (20.0, 110.0, 200.0, 290.0)
FOR_TWO = (45.0, 135.0, 225.0, 315.0)


def make(request: Request) -> Picture:
    """Solve for one and for two locked joints, and draw four members of each."""
    rows = [
        _row(matrix, locked)
        for locked, wanted in ((2, FOR_TWO), (1, FOR_ONE))
        for matrix in nearest(optima(4, request, locked), wanted)
    ]
    table = pd.DataFrame(rows)
    with styled(WIDTH, HEIGHT) as figure:
        sigma = table["sigma_one_locked"].min()
        figure.suptitle(
            f"The family of optimal planar 4R: σ = √½ = {sigma:.4f} whichever joint locks\n",
            fontsize=TITLE,
        )
        for axes, row in zip(figure.subplots(2, 4).ravel(), rows, strict=True):
            arm = realise(np.array(row["jacobian"]))
            draw_on_circle(axes, arm, columns=False, weight=0.7)
            two = row["sigma_two_locked"]
            title = f"α = {row['alpha_degrees']:.1f}°\nσ after two failures {two:.3f}"
            colour = VERMILION if row["optimal_for_locked"] == 2 else INK
            axes.set_title(title, fontsize=SMALL + 0.5, loc="center", color=colour)
    return Picture(figure, table)


def in_family(matrix: FloatArray) -> FloatArray:
    """Return a planar 4R optimum as eq. (16) writes it, but upside down: j₁ along −x.

    Joint 1 is then below the end effector. j₂ ⊥ j₁ and j₄ ⊥ j₃, each 90° ahead of its
    partner. Columns keep their signs as far as that allows, so that α, the angle from j₁ to
    j₃, may be anywhere in [0, 2π).
    """
    doubled = np.cos(2 * (angles(matrix) - angles(matrix)[0]))
    partner = 1 + int(np.argmin(doubled[1:]))
    first, *rest = [i for i in range(4) if i != partner]
    ordered = turned(matrix[:, [first, partner, *rest]], np.pi)
    for one, other in ((0, 1), (2, 3)):
        ahead = np.linalg.det(ordered[:, [one, other]])
        ordered[:, other] *= np.sign(ahead)
    return np.asarray(ordered)


def alpha(member: FloatArray) -> float:
    """Return the parameter of a member written as eq. (16) does, in [0, 2π)."""
    first, _, third, _ = angles(member)
    return float(np.mod(third - first, 2 * np.pi))


def nearest(matrices: list[FloatArray], wanted: tuple[float, ...]) -> list[FloatArray]:
    """Return, for each angle in degrees, the member whose α is nearest to it."""
    members = [in_family(matrix) for matrix in matrices]
    own = np.degrees([alpha(member) for member in members])
    off = [np.abs((own - angle + 180) % 360 - 180) for angle in wanted]
    return [members[int(np.argmin(one))] for one in off]


def _row(matrix: FloatArray, locked: int) -> dict[str, object]:
    return {
        "optimal_for_locked": locked,
        "alpha_degrees": float(np.degrees(alpha(matrix))),
        "sigma_one_locked": measures.worst_case_sigma(matrix),
        "sigma_two_locked": measures.worst_case_sigma(matrix, 2),
        "jacobian": matrix.tolist(),
    }
