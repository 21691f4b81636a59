"""The paper's Fig. 1: planar 3R manipulators that have the optimal Jacobian (12).

The Jacobian is solved for, by max-min. Orders and signs of its columns give 48 arrangements,
four of them different manipulators: all are drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import max_min, measures
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.plot.manipulator import draw
from formulations.plot.picture import Picture, Request, reached, solved
from formulations.plot.style import LABEL, PALE, TITLE, styled
from formulations.solving.case import Case
from formulations.synthesis.family import distinct, every, symmetries
from formulations.synthesis.from_jacobian import realise
from formulations.synthesis.links import link_lengths
from formulations.synthesis.manipulator import Manipulator
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Half the width of a panel, in radii of the circle that joints sit on.
ROOM = 1.22
WIDTH, HEIGHT = 7.4, 7.8


def make(request: Request) -> Picture:
    """Solve, realise and draw all distinct arrangements."""
    matrix = printed_form(optima(3, request)[0])
    first = realise(matrix)
    found = distinct(every(first), symmetries(first))
    arms = [first.arranged(o, f) for o, f in zip(found.orders, found.flips, strict=True)]
    table = pd.DataFrame([_row(arm) for arm in arms])
    with styled(WIDTH, HEIGHT) as figure:
        sigma = measures.worst_case_sigma(matrix)
        what = f"σ = √⅓ = {sigma:.4f} whichever joint locks"
        figure.suptitle(f"Planar 3R with the optimal Jacobian: {what}\n", fontsize=TITLE)
        panels = figure.subplots(-(-len(arms) // 2), 2, squeeze=False).ravel()
        for axes, arm, lengths in zip(panels, arms, table["link_lengths"], strict=False):
            draw_on_circle(axes, arm)
            links = ", ".join(f"{length:.3f}" for length in lengths)
            axes.set_title(f"links {links}", fontsize=LABEL, loc="center")
        for axes in panels[len(arms) :]:
            axes.set_axis_off()
    return Picture(figure, table)


def printed_form(matrix: FloatArray) -> FloatArray:
    """Return the Jacobian as eq. (12) prints it: signs such that j₁ + j₂ + j₃ = 0, j₁ along −x.

    Columns follow one another counter-clockwise.
    """
    signs = np.sign(np.linalg.svd(matrix)[2][-1])
    signed = turned(matrix * signs, np.pi)
    around = np.mod(angles(signed) - np.pi, 2 * np.pi)
    around[0] = 0.0
    return np.asarray(signed[:, np.argsort(around)])


def optima(joints: int, request: Request, locked: int = 1) -> list[FloatArray]:
    """Return the planar Jacobians of the starts that reached the best worst case, tr JJᵀ = 2.

    Raises
    ------
    NothingFoundError
        If no start led to a Jacobian that passes the gate.
    KeyboardInterrupt
        If the user interrupted.
    """
    request.progress(f"max-min, planar {joints}R, {locked} locked")
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    case = Case(max_min, arm, {"locked": locked})
    return [record.jacobian for record in reached(solved(case, request))]


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


def draw_on_circle(
    axes: Axes, arm: Manipulator, columns: bool = True, weight: float = 1.0
) -> None:
    """Draw an arm, and the circle about the end effector on which its joints sit.

    Joints are counted from 0, in the paper from 1. Columns of one norm put all joints at one
    distance; the panel shows no more than the circle, so that all panels have one scale. See
    `draw`.
    """
    draw(arm, axes, columns=columns, weight=weight)
    away = arm.points[:, :2] - arm.end_effector[:2]
    radius = float(np.max(np.linalg.norm(away, axis=1)))
    turn = np.linspace(0, 2 * np.pi, 181)
    x, y = arm.end_effector[:2]
    circle = x + radius * np.cos(turn), y + radius * np.sin(turn)
    axes.plot(*circle, color=PALE, lw=0.6, zorder=0)
    half = ROOM * radius
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))


def _row(arm: Manipulator) -> dict[str, object]:
    matrix = arm.jacobian()
    return {
        "columns": list(arm.columns),
        "joint_positions": arm.points[:, :2].tolist(),
        "link_lengths": link_lengths(arm.points, arm.end_effector).tolist(),
        "jacobian": matrix.tolist(),
        "locked_singular_values": measures.locked_singular_values(matrix).tolist(),
    }
