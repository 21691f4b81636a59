"""The README's picture: a planar arm at one place of its tool, in a usual posture and its best.

The arm has three revolute joints and three links of length 1, so its tool's velocity has two
directions: the Jacobian J has shape (2, 3). Joint angles, shape (3,), are in radians, each from
the link before. An ellipse has the velocities of the tool for joint velocities of size 1: its
half axes are the singular values of J. The worst joint is the one after whose lock the smaller
half axis, σ, is shortest; that is the narrow ellipse.

Run it with ``python results/figures/locked_joint.py``; it writes ``locked_joint.svg`` here.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from lockedjoint.figures.style import GREY, INK, ORANGE, VERMILION, legend, styled
from lockedjoint.formulations.measures import worst_case, worst_case_sigma_batch
from lockedjoint.nlp.arrays import FloatArray
from results.script import save

#: Joint angles of a zigzag, as arms often stand. Another posture moves the tool's place for
#: both pictures.
USUAL = np.radians([75.0, -110.0, 60.0])
# Blue, light enough for another ellipse to be seen before it.
_PALE_BLUE = "#B3D5E8"
# The length that is drawn for a velocity of 1, in lengths of a link. It changes the size of the
# ellipses alone.
_LENGTH_OF_VELOCITY = 0.4
# The number of directions of the last link among which the best posture is sought. With more of
# them the best is a little better.
_DIRECTIONS = 20_000
# Width and height of the picture in inches.
_SIZE_INCHES = (4.1, 3.7)


def places(angles: FloatArray) -> FloatArray:
    """Return where the joints are, and the tool at last, shape (4, 2)."""
    heads = np.cumsum(angles)
    return np.vstack([np.zeros(2), np.cumsum(np.stack([np.cos(heads), np.sin(heads)], 1), 0)])


def jacobian(angles: FloatArray) -> FloatArray:
    """Return the Jacobian of the tool's position, shape (2, 3).

    A joint moves the tool at right angles to the line (x, y) from it to the tool: by (−y, x).
    """
    away = places(angles)[-1] - places(angles)[:-1]
    return np.stack([-away[:, 1], away[:, 0]])


def postures(tool: FloatArray) -> list[FloatArray]:
    """Return postures with the tool there: one for each direction of the last link.

    The wrist is the third joint. The two links before it are the sides of length 1 of a
    triangle whose base is the reach, so the angle at the base is arccos(reach / 2). Of the
    two such postures, mirror images, the one with its elbow to the left is taken.
    """
    found = []
    for last in np.linspace(-np.pi, np.pi, _DIRECTIONS, endpoint=False):
        wrist = tool - [np.cos(last), np.sin(last)]
        if 0 < (reach := float(np.hypot(*wrist))) < 2:
            first = np.arctan2(wrist[1], wrist[0]) + np.arccos(reach / 2)
            second = -2 * np.arccos(reach / 2)
            found.append(np.array([first, second, last - first - second]))
    return found


def draw(axes: Axes, angles: FloatArray) -> None:
    """Draw the arm, its worst joint, and the tool's velocities before and after the lock."""
    points, matrix = places(angles), jacobian(angles)
    worst = worst_case(matrix)
    locked = worst.joints[0]
    remaining = np.delete(matrix, locked, axis=1)
    for columns, colour in ((matrix, _PALE_BLUE), (remaining, ORANGE)):
        axis, size, _ = np.linalg.svd(columns)
        turn = np.degrees(np.arctan2(axis[1, 0], axis[0, 0]))
        width, height = 2 * _LENGTH_OF_VELOCITY * size
        style = {"angle": turn, "fc": colour, "ec": colour, "lw": 1.5}
        axes.add_patch(Ellipse(tuple(points[-1]), width, height, **style))
    axes.plot(*points.T, color=GREY, lw=5, solid_capstyle="round", zorder=2)
    for k, point in enumerate(points[:-1]):
        colour = VERMILION if k == locked else INK
        axes.plot(*point, "s" if k == locked else "o", color=colour, ms=11, zorder=3)
    axes.plot(*points[-1], "o", color=INK, ms=5, zorder=3)
    axes.set_title(f"joint {locked + 1} locked:\nσ = {worst.sigma:.2f}", loc="center")
    axes.set_aspect("equal")
    axes.set_axis_off()


def main() -> None:
    """Draw both postures beside this file."""
    others = postures(places(USUAL)[-1])
    best = others[np.argmax(worst_case_sigma_batch([jacobian(q) for q in others]).sigma)]
    with styled(*_SIZE_INCHES) as figure:
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        draw(left, USUAL)
        draw(right, best)
        names = {
            "tool velocities with all joints": _PALE_BLUE,
            "after the worst joint has locked": ORANGE,
            "the joint that locked": VERMILION,
        }
        legend(figure, names, 1)
    save(figure, Path(__file__).with_suffix(".svg"))


if __name__ == "__main__":
    main()
