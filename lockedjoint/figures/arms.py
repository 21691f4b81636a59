"""Manipulators that have optimal Jacobians: the paper's Figs. 1 and 3, and seven axes.

Each Jacobian that is drawn was solved for, by max-min, unless one is given. J has the shape
(m, n), one column j_i per joint, counted from 1 as in the paper; σ is its worst case, the least
singular value that a failure leaves. Planar ones (m = 2) have tr JJᵀ = 2, so that both singular
values are 1 where they are equal. A planar revolute joint sits at the distance |j_i| from the
end effector: all joints are on a circle where the columns have equal norms. Angles are radians
from x towards y, but those in degrees whose names say so.

The rows of a `Picture` are, in `figure_1`, one for each arm: its columns from base to tip,
joints' positions (n × 2) and lengths of links in metres, J as nested lists, and σ after each
failure. In `figure_3` there is one for each member of the family: locked joints for which it
was optimised, α in degrees, σ after one and two failures, and J. In `seven_axes` there is one
for each joint: its number from 0, direction (unit vector), nearest point to the end effector
and its distance (metres, from the end effector), and σ after its failure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lockedjoint.figures import style
from lockedjoint.figures.manipulator import common_lever, draw, draw_axes
from lockedjoint.figures.style import Picture, reached
from lockedjoint.figures.views import clear_views
from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import FreeColumn, UnitRevolute
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.synthesis.family import distinct, every, symmetries
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import link_lengths
from lockedjoint.synthesis.manipulator import Manipulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A panel is twice as wide as this, in radii of the circle that joints sit on.
_HALF_PANEL_RADII = 1.22
# A drawn axis is twice as long as this, in radii.
_HALF_AXIS_RADII = 0.62
# The panel is larger than its axes by this factor, which leaves room for names.
_PANEL_PER_AXES = 1.1
# Fig. 3 shows the members whose α is nearest to these angles, by the number of locked joints.
# Those of two are where optima are: odd multiples of 45°. Those of one are arbitrary.
_ALPHAS_DEG = {2: (45.0, 135.0, 225.0, 315.0), 1: (20.0, 110.0, 200.0, 290.0)}
# Width and height of the figures, in inches.
_FIGURE_1_INCHES = (7.4, 7.8)
_FIGURE_3_INCHES = (8.4, 5.6)
_SEVEN_AXES_INCHES = (8.4, 4.6)
# Factor on the widths of lines in the small panels of Fig. 3.
_SMALL_WEIGHT = 0.7
# Number of points that a circle is drawn with. More make it smoother.
_CIRCLE_POINTS = 181


def figure_1(effort: Effort) -> Picture:
    """Draw all planar 3R manipulators that have the optimal Jacobian (12).

    Orders and signs of its columns give 48 arrangements, four of them different manipulators.
    """
    matrix = printed_form(optima(3, effort)[0])
    first = realise(matrix)
    different = distinct(every(first), symmetries(first))
    arms = [
        first.arranged(*each) for each in zip(different.orders, different.flips, strict=True)
    ]
    rows = [
        {
            "columns": list(arm.columns),
            "joint_positions": arm.points[:, :2].tolist(),
            "link_lengths": link_lengths(arm.points, arm.end_effector).tolist(),
            "jacobian": arm.jacobian().tolist(),
            "locked_singular_values": measures.locked_singular_values(arm.jacobian()).tolist(),
        }
        for arm in arms
    ]
    with style.styled(*_FIGURE_1_INCHES) as figure:
        what = f"σ = √⅓ = {measures.worst_case_sigma(matrix):.4f} whichever joint locks"
        figure.suptitle(f"Planar 3R with the optimal Jacobian: {what}\n")
        # Two panels a row, and as many rows as the arms need.
        panels = figure.subplots(-(-len(arms) // 2), 2, squeeze=False).ravel()
        for axes, arm, row in zip(panels, arms, rows, strict=False):
            _draw_on_circle(axes, arm)
            links = ", ".join(f"{length:.3f}" for length in row["link_lengths"])
            axes.set_title(f"links {links}", fontsize="medium", loc="center")
        for axes in panels[len(arms) :]:
            axes.set_axis_off()
    return Picture(figure, rows)


def figure_3(effort: Effort) -> Picture:
    """Draw eight members of the family (16) of optimal planar 4R manipulators.

    Max-min for one locked joint ends anywhere on the family, for two at odd multiples of π/4.
    The α of each member is measured.
    """
    rows = [
        {
            "optimal_for_failures": failures,
            "alpha_degrees": float(np.degrees(alpha(matrix))),
            "sigma_one_locked": measures.worst_case_sigma(matrix),
            "sigma_two_locked": measures.worst_case_sigma(matrix, 2),
            "jacobian": matrix.tolist(),
        }
        for failures, wanted in _ALPHAS_DEG.items()
        for matrix in nearest(optima(4, effort, failures), wanted)
    ]
    with style.styled(*_FIGURE_3_INCHES) as figure:
        least = min(row["sigma_one_locked"] for row in rows)
        what = f"σ = √½ = {least:.4f} whichever joint locks"
        figure.suptitle(f"The family of optimal planar 4R: {what}\n")
        for axes, row in zip(figure.subplots(2, 4).ravel(), rows, strict=True):
            arm = realise(np.array(row["jacobian"]))
            _draw_on_circle(axes, arm, columns=False, weight=_SMALL_WEIGHT)
            two = row["sigma_two_locked"]
            title = f"α = {row['alpha_degrees']:.1f}°\nafter two failures\nσ = {two:.3f}"
            colour = style.VERMILION if row["optimal_for_failures"] == 2 else style.INK
            axes.set_title(title, fontsize=style.SMALL, loc="center", color=colour)
    return Picture(figure, rows)


def seven_axes(effort: Effort, jacobian: FloatArray | None = None) -> Picture:
    """Draw the axes of the 7R optimum, or of the Jacobian given, from two sides.

    A revolute joint with |v| = |ω| = 1 has its axis at the distance 1 from the end effector: a
    tangent of the unit sphere about it. The order of the joints does not matter here.
    InputError if the Jacobian, shape (6, n), has another number of rows or prismatic joints.
    """
    matrix = jacobian
    if matrix is None:
        matrix = reached(Case(max_min, Arm.of(UnitRevolute(), 7)), effort).best.jacobian
    if matrix.shape[0] != 6:
        shape = "×".join(map(str, matrix.shape))
        raise InputError("jacobian", f"of shape {shape}", "6 rows, for seven-axes")
    arm = realise(matrix)
    if np.any(arm.prismatic):
        raise InputError("jacobian", "with a prismatic joint", "revolute joints only")
    distances = np.linalg.norm(arm.points - arm.end_effector, axis=1)
    with style.styled(*_SEVEN_AXES_INCHES) as figure:
        tangent = common_lever(arm) > 0
        what = "axes tangent to a sphere" if tangent else "axes, and the sphere of their mean"
        sigma = measures.worst_case_sigma(matrix)
        number = "Seven" if arm.joints == 7 else str(arm.joints)
        figure.suptitle(f"{number} {what}: σ ≥ {sigma:.4f} whichever joint locks")
        # The same for both panels: how far axes reach in space.
        half = _PANEL_PER_AXES * float(np.max(distances)) * np.hypot(1, _HALF_AXIS_RADII)
        sides = ("from one side", "a quarter turn on")
        for axes, view, side in zip(
            figure.subplots(1, 2), clear_views(arm), sides, strict=True
        ):
            draw_axes(arm, axes, view, float(np.mean(distances)), _HALF_AXIS_RADII)
            axes.set(xlim=(-half, half), ylim=(-half, half))
            axes.set_title(side, fontsize=style.SMALL, color=style.GREY, loc="center", y=-0.02)
    shown = {
        "joint": range(arm.joints),
        "direction": arm.directions.tolist(),
        "nearest_point": (arm.points - arm.end_effector).tolist(),
        "distance": distances.tolist(),
        "sigma_when_locked": measures.locked_singular_values(matrix).tolist(),
    }
    rows = [dict(zip(shown, row, strict=True)) for row in zip(*shown.values(), strict=True)]
    return Picture(figure, rows)


def optima(joints: int, effort: Effort, failures: int = 1) -> list[FloatArray]:
    """Return planar Jacobians, (2, joints), of the starts that reached the best worst case.

    They have tr JJᵀ = 2, which their columns share as they like.
    """
    effort.progress(f"max-min, planar {joints}R, {failures} locked")
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    case = Case(max_min, arm, {"failures": failures})
    return [record.jacobian for record in reached(case, effort).reached]


def printed_form(matrix: FloatArray) -> FloatArray:
    """Return the Jacobian as eq. (12) prints it: signs such that j₁ + j₂ + j₃ = 0, j₁ along −x.

    Columns follow one another counter-clockwise. Shape (2, 3). Its null space is spanned by
    (±1, ±1, ±1), and these are the signs.
    """
    signs = np.sign(np.linalg.svd(matrix)[2][-1])
    signed = turned(matrix * signs, np.pi)
    around = np.mod(angles(signed) - np.pi, 2 * np.pi)
    around[0] = 0.0
    return np.asarray(signed[:, np.argsort(around)])


def in_family(matrix: FloatArray) -> FloatArray:
    """Return a planar 4R optimum as eq. (16) writes it, but upside down: j₁ along −x.

    Joint 1 is then below the end effector. j₂ ⊥ j₁ and j₄ ⊥ j₃, each 90° ahead of its
    partner. Columns keep their signs as far as that allows, so that α, the angle from j₁ to
    j₃, may be anywhere in [0, 2π).
    """
    # The partner of column 1 is orthogonal to it: the cosine of twice their angle is −1.
    doubled = np.cos(2 * (angles(matrix) - angles(matrix)[0]))
    partner = 1 + int(np.argmin(doubled[1:]))
    first, *rest = [i for i in range(4) if i != partner]
    ordered = turned(matrix[:, [first, partner, *rest]], np.pi)
    for pair in ([0, 1], [2, 3]):
        ordered[:, pair[1]] *= np.sign(np.linalg.det(ordered[:, pair]))
    return np.asarray(ordered)


def alpha(member: FloatArray) -> float:
    """Return α of a member, shape (2, 4), as eq. (16) writes it: from j₁ to j₃, in [0, 2π)."""
    first, _, third, _ = angles(member)
    return float(np.mod(third - first, 2 * np.pi))


def nearest(matrices: list[FloatArray], wanted: tuple[float, ...]) -> list[FloatArray]:
    """Return, for each angle in degrees, the member whose α is nearest to it."""
    members = [in_family(matrix) for matrix in matrices]
    own = np.degrees([alpha(member) for member in members])
    # Angles are compared modulo a whole turn.
    off = [np.abs((own - angle + 180) % 360 - 180) for angle in wanted]
    return [members[int(np.argmin(distances))] for distances in off]


def turned(matrix: FloatArray, direction: float) -> FloatArray:
    """Return the Jacobian in the frame in which its first column has this direction.

    The direction is an angle in radians, from x towards y.
    """
    angle = direction - np.arctan2(matrix[1, 0], matrix[0, 0])
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(np.array([[c, -s], [s, c]]) @ matrix)


def angles(matrix: FloatArray) -> FloatArray:
    """Return the angles of the columns from x towards y, in radians, shape (n,)."""
    return np.asarray(np.arctan2(matrix[1], matrix[0]))


def _draw_on_circle(
    axes: Axes, arm: Manipulator, columns: bool = True, weight: float = 1.0
) -> None:
    """Draw an arm, and the circle about the end effector on which its joints sit.

    Joints are counted from 0, in the paper from 1. The panel shows no more than the circle, so
    that all panels have one scale.
    """
    draw(arm, axes, columns=columns, weight=weight)
    away = arm.points[:, :2] - arm.end_effector[:2]
    radius = float(np.max(np.linalg.norm(away, axis=1)))
    angle = np.linspace(0, 2 * np.pi, _CIRCLE_POINTS)
    x, y = arm.end_effector[:2]
    circle = x + radius * np.cos(angle), y + radius * np.sin(angle)
    axes.plot(*circle, color=style.PALE, lw=0.6, zorder=0)
    half = _HALF_PANEL_RADII * radius
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
