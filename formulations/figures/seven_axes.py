"""The 7R max-min optimum as seven axes tangent to a sphere.

A revolute joint with |v| = |ω| = 1 has its axis at the distance 1 from the end effector: a
tangent of the unit sphere about it. The order of the joints does not matter here.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from formulations import max_min, measures, style
from formulations.comparison.contender import Contender
from formulations.figure_file import figure_class
from formulations.figures.picture import Picture, Request, best, solved
from formulations.realise.axes import realise
from formulations.realise.drawing import draw
from formulations.realise.manipulator import Manipulator
from formulations.realise.projection import clear_views
from nlp.arrays import FloatArray
from nlp.errors import InputError

WIDTH, HEIGHT = 9.0, 5.0


def make(request: Request) -> Picture:
    """Solve, or take the Jacobian given, and draw its axes from two sides."""
    matrix = _matrix(request)
    arm = realise(matrix)
    names = [str(i + 1) for i in range(arm.joints)]
    with style.applied():
        figure = figure_class()(figsize=(WIDTH, HEIGHT))
        figure.suptitle(_title(arm, matrix), fontsize=style.SAID)
        for axes, view in zip(figure.subplots(1, 2), clear_views(arm), strict=True):
            draw(arm, axes, view, names, links=False)
    table = pd.DataFrame(
        {
            "joint": range(1, arm.joints + 1),
            "direction": arm.directions.tolist(),
            "point_nearest": arm.points.tolist(),
            "distance": np.linalg.norm(arm.points - arm.end_effector, axis=1),
            "sigma_when_locked": measures.locked_singular_values(matrix),
        }
    )
    return Picture(figure, table)


def _matrix(request: Request) -> FloatArray:
    if request.jacobian is None:
        return best(solved(Contender(max_min.NAME, "unit-revolute"), request)).jacobian
    if request.jacobian.shape[0] != 6:
        shape = "×".join(map(str, request.jacobian.shape))
        raise InputError("--jacobian", f"of shape {shape}", "6 rows, for seven-axes")
    return request.jacobian


def _title(arm: Manipulator, matrix: FloatArray) -> str:
    distances = np.linalg.norm(arm.points - arm.end_effector, axis=1)
    tangent = np.ptp(distances) < 1e-3 and not np.any(arm.prismatic)
    what = "axes tangent to one sphere" if tangent else "axes about the end effector"
    sigma = measures.worst_case_sigma(matrix)
    counted = {7: "Seven", 8: "Eight", 9: "Nine"}.get(arm.joints, str(arm.joints))
    return f"{counted} {what}: σ ≥ {sigma:.4f} whichever joint locks"
