"""The paper's Fig. 1: planar 3R manipulators that have the optimal Jacobian (12).

The Jacobian is solved for, by max-min. Orders and signs of its columns give 48 arrangements,
four of them different manipulators: all are drawn.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from formulations import measures
from formulations.figures.picture import Picture, Request
from formulations.figures.planar import angles, draw_on_circle, optima, turned
from formulations.files.figure import LABEL, TITLE, styled
from formulations.realise.family import distinct, every, symmetries
from formulations.realise.from_jacobian import realise
from formulations.realise.links import link_lengths
from formulations.realise.manipulator import Manipulator
from nlp.arrays import FloatArray

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


def _row(arm: Manipulator) -> dict[str, object]:
    matrix = arm.jacobian()
    return {
        "columns": list(arm.columns),
        "joint_positions": arm.points[:, :2].tolist(),
        "link_lengths": link_lengths(arm.points, arm.end_effector).tolist(),
        "jacobian": matrix.tolist(),
        "locked_singular_values": measures.locked_singular_values(matrix).tolist(),
    }
