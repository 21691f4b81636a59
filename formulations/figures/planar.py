"""Planar optima, solved for: Jacobians with JJᵀ = I, in the frame of the paper's examples."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from formulations import max_min
from formulations.figures.picture import NothingFoundError, Request
from formulations.files import figure_style
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.measures.jacobian import worst_case_sigma
from formulations.realise.manipulator import Manipulator
from nlp.arrays import FloatArray
from nlp.multistart import multistart

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# What a start reaches counts as the optimum within this.
REACH = 1e-6
# Half the width of a panel, in radii of the circle that joints sit on.
ROOM = 1.22


def optima(joints: int, request: Request, locked: int = 1) -> list[FloatArray]:
    """Return the Jacobians of the starts that reached the best worst case, tr JJᵀ = 2.

    Raises
    ------
    NothingFoundError
        If no start reached anything.
    KeyboardInterrupt
        If the user interrupted.
    """
    request.progress(f"max-min, planar {joints}R, {locked} locked")
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    study = multistart(
        partial(max_min.build, arm, locked),
        arm.sample,
        starts=request.starts,
        rng=request.seed,
        options=max_min.OPTIONS,
    )
    if not study.complete:
        raise KeyboardInterrupt
    matrices = [result.solution.outputs["jacobian"] for result in study.results]
    finite = [matrix for matrix in matrices if np.all(np.isfinite(matrix))]
    if not finite:
        raise NothingFoundError("No start reached a Jacobian; ask for more starts.")
    top = max(worst_case_sigma(matrix, locked) for matrix in finite)
    return [one for one in finite if worst_case_sigma(one, locked) >= top - REACH]


def turned(matrix: FloatArray, direction: float) -> FloatArray:
    """Return the Jacobian in the frame in which its first column has this direction.

    The direction is an angle in radians, from x towards y.
    """
    angle = direction - np.arctan2(matrix[1, 0], matrix[0, 0])
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(np.array([[c, -s], [s, c]]) @ matrix)


def angles(matrix: FloatArray) -> FloatArray:
    """Angles of the columns from x towards y, in radians, shape (n,)."""
    return np.asarray(np.arctan2(matrix[1], matrix[0]))


def round_tip(axes: Axes, arm: Manipulator) -> None:
    """Draw the circle about the end effector on which joints sit, and show no more than it.

    Columns of one norm put all joints at one distance; panels are then of one scale.
    """
    away = arm.points[:, :2] - arm.end_effector[:2]
    radius = float(np.max(np.linalg.norm(away, axis=1)))
    turn = np.linspace(0, 2 * np.pi, 181)
    x, y = arm.end_effector[:2]
    circle = x + radius * np.cos(turn), y + radius * np.sin(turn)
    axes.plot(*circle, color=figure_style.PALE, lw=0.6, zorder=0)
    axes.set_xlim(x - ROOM * radius, x + ROOM * radius)
    axes.set_ylim(y - ROOM * radius, y + ROOM * radius)
