"""Planar optima, solved for: Jacobians with JJᵀ = I, in the frame of the paper's examples."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from formulations import max_min
from formulations.figures.picture import Request, reached
from formulations.files.figure import PALE
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.realise.drawing import draw
from formulations.realise.manipulator import Manipulator
from formulations.solving.outcome import Outcome
from formulations.solving.record import judge
from formulations.solving.setup import Setup
from nlp.arrays import FloatArray
from nlp.multistart import multistart

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Half the width of a panel, in radii of the circle that joints sit on.
ROOM = 1.22


def optima(joints: int, request: Request, locked: int = 1) -> list[FloatArray]:
    """Return the Jacobians of the starts that reached the best worst case, tr JJᵀ = 2.

    Raises
    ------
    NothingFoundError
        If no start led to a Jacobian that passes the gate.
    KeyboardInterrupt
        If the user interrupted.
    """
    request.progress(f"max-min, planar {joints}R, {locked} locked")
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    setup = Setup(max_min.NAME, "free-mean", locked=locked)
    study = multistart(
        partial(max_min.build, arm, locked),
        arm.sample,
        starts=request.starts,
        rng=request.seed,
        options=max_min.OPTIONS,
        judge=partial(judge, arm=arm, merit=setup.merit(), locked=locked),
    )
    if not study.complete:
        raise KeyboardInterrupt
    outcome = Outcome(setup, arm, study.results, study.complete)
    return [record.jacobian for record in reached(outcome)]


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

    Joints are numbered from 1. Columns of one norm put all joints at one distance; the panel
    shows no more than the circle, so that all panels have one scale. See `draw`.
    """
    labels: Sequence[str] = [str(i + 1) for i in range(arm.joints)]
    draw(arm, axes, labels=labels, columns=columns, weight=weight)
    away = arm.points[:, :2] - arm.end_effector[:2]
    radius = float(np.max(np.linalg.norm(away, axis=1)))
    turn = np.linspace(0, 2 * np.pi, 181)
    x, y = arm.end_effector[:2]
    circle = x + radius * np.cos(turn), y + radius * np.sin(turn)
    axes.plot(*circle, color=PALE, lw=0.6, zorder=0)
    axes.set_xlim(x - ROOM * radius, x + ROOM * radius)
    axes.set_ylim(y - ROOM * radius, y + ROOM * radius)
