"""The 7R max-min optimum as seven axes tangent to a sphere.

A revolute joint with |v| = |ω| = 1 has its axis at the distance 1 from the end effector: a
tangent of the unit sphere about it. The order of the joints does not matter here.
"""

import numpy as np
import pandas as pd

from formulations import max_min, measures
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.plot.manipulator import common_lever, draw_axes
from formulations.plot.picture import Picture, Request, reached
from formulations.plot.projection import clear_views
from formulations.plot.style import GREY, SMALL, styled
from formulations.solving.case import Case
from formulations.synthesis.from_jacobian import realise
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Half the length of a drawn axis, in radii. Room about axes and their names.
_REACH, _ROOM = 0.62, 1.1


def make(request: Request) -> Picture:
    """Solve, or take the Jacobian given, and draw its axes from two sides."""
    matrix = _matrix(request)
    arm = realise(matrix)
    if np.any(arm.prismatic):
        raise InputError("--jacobian", "with a prismatic joint", "revolute joints only")
    distances = np.linalg.norm(arm.points - arm.end_effector, axis=1)
    with styled(8.4, 4.6) as figure:
        tangent = common_lever(arm) > 0
        what = "axes tangent to a sphere" if tangent else "axes, and the sphere of their mean"
        sigma = measures.worst_case_sigma(matrix)
        number = "Seven" if arm.joints == 7 else str(arm.joints)
        figure.suptitle(f"{number} {what}: σ ≥ {sigma:.4f} whichever joint locks")
        # The same for both panels: how far axes reach in space.
        farthest = float(np.max(distances))
        half = _ROOM * farthest * np.hypot(1, _REACH)
        sides = ("from one side", "a quarter turn on")
        for axes, view, side in zip(
            figure.subplots(1, 2), clear_views(arm), sides, strict=True
        ):
            draw_axes(arm, axes, view, float(np.mean(distances)), _REACH)
            axes.set(xlim=(-half, half), ylim=(-half, half))
            axes.set_title(side, fontsize=SMALL, color=GREY, loc="center", y=-0.02)
    table = pd.DataFrame(
        {
            "joint": range(arm.joints),
            "direction": arm.directions.tolist(),
            "nearest_point": (arm.points - arm.end_effector).tolist(),
            "distance": distances,
            "sigma_when_locked": measures.locked_singular_values(matrix),
        }
    )
    return Picture(figure, table)


def _matrix(request: Request) -> FloatArray:
    if request.jacobian is None:
        return reached(Case(max_min, Arm.of(UnitRevolute(), 7)), request).best.jacobian
    if request.jacobian.shape[0] != 6:
        shape = "×".join(map(str, request.jacobian.shape))
        raise InputError("--jacobian", f"of shape {shape}", "6 rows, for seven-axes")
    return request.jacobian
