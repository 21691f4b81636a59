"""Every number that a figure shows is what NumPy finds in the Jacobians that are drawn.

The first start of every problem is replaced by one that stopped early, with a ‖J‖ far from
what is allowed and better than any other by its own account: no figure shows it.
"""

import json
import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from formulations.joints.models import arm
from formulations.plot import optima, trade_off
from formulations.plot.figures import FIGURES
from formulations.plot.picture import Request
from formulations.registry import bound
from formulations.reproduction import reference
from formulations.solving import record, solve

STARTS = {"figure-1": 3, "figure-3": 8, "trade-off": 2, "optima": 2}
RECORDS = []


def unfinished(one):
    """The record of a start that stopped early, far from feasible, but with the best values."""
    return replace(
        one,
        status=replace(one.status, return_status="Maximum_Iterations_Exceeded"),
        violation=334.0,
        score=0.0 if np.isclose(one.score, one.isotropy_defect) else 13 * one.worst_case_sigma,
        worst_case_sigma=13 * one.worst_case_sigma,
        isotropy_defect=0.0,
        jacobian=13 * one.jacobian,
    )


@pytest.fixture(scope="module")
def drawn():
    """Every figure that the command knows, by name."""

    def judge(*arguments, **keywords):
        found = record.judge(*arguments, **keywords)
        RECORDS.append(unfinished(found) if found.index == 0 else found)
        return RECORDS[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve, "judge", judge)
        patch.setattr(trade_off.make, "__defaults__", (3,))  # points of each curve
        return {
            name: kind.make(Request(starts=STARTS.get(name, 2)))
            for name, kind in FIGURES.items()
        }


def texts(figure):
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    for axes in figure.axes:
        found += [axes.get_title(where) for where in ("left", "center", "right")]
        found += [axes.get_xlabel(), axes.get_ylabel()]
    return [figure.get_suptitle(), *found]


def worst(matrix, locked=1):
    """Eq. (5): the least singular value that is left after any joints lock."""
    left = (np.delete(matrix, f, axis=1) for f in combinations(range(matrix.shape[1]), locked))
    return min(np.linalg.svd(one, compute_uv=False)[-1] for one in left)


def jacobians(table):
    return [np.array(json.loads(j) if isinstance(j, str) else j) for j in table["jacobian"]]


def by_circle(axes):
    """The planar Jacobian of the joints drawn; the end effector is drawn at the origin."""
    pins = [line.get_xydata()[0] for line in axes.lines if len(line.get_xydata()) == 1]
    return upright(np.array([[y, -x] for x, y in pins if np.hypot(x, y) > 1e-6]).T)


def upright(matrix):
    """The Jacobian with its columns in one order, and with signs such that x ≥ 0."""
    signs = np.where(np.abs(matrix[0]) > 1e-9, np.sign(matrix[0]), np.sign(matrix[1]))
    signed = np.round(matrix * signs, 7) + 0.0
    return signed[:, np.lexsort(signed)]


def distance(matrix):
    m = len(matrix)
    return np.linalg.norm(matrix @ matrix.T - np.sum(matrix**2) / m * np.eye(m))


def recomputed(name, picture):
    """The numbers that a figure may show, from J alone; and that it shows those of its J."""
    table, axes = picture.table, picture.figure.axes
    if name == "figure-1":
        found = []
        for panel, joints, matrix in zip(
            axes, table["joint_positions"], jacobians(table), strict=True
        ):
            np.testing.assert_allclose(by_circle(panel), upright(matrix), atol=1e-6)
            found += [*np.linalg.norm(np.diff([*joints, [0, 0]], axis=0), axis=1)]
            found += [worst(matrix)]
        return found
    if name == "figure-3":
        found = []
        for panel, matrix in zip(axes, jacobians(table), strict=True):
            np.testing.assert_allclose(by_circle(panel), upright(matrix), atol=1e-6)
            said = panel.get_title("center")
            degrees, two = map(float, re.findall(r"\d+\.\d+", said))
            assert two == pytest.approx(worst(matrix, 2), abs=6e-4), said
            family = -reference.planar_4r(np.radians(degrees))[:2]
            np.testing.assert_allclose(matrix, family, atol=1e-3)
            found += [degrees, two, worst(matrix)]
        return found
    if name == "seven-axes":
        points, ways = (np.array(table[key].tolist()) for key in ("nearest_point", "direction"))
        return [worst(np.vstack([np.cross(points, ways).T, ways.T]))]
    if name == "trade-off":
        found = [np.sqrt(1 / 3)]  # eq. (6), and the largest of the ends
        curves = axes[0].lines[::3]  # each with two lines of points after it
        by_model = table.groupby("model", sort=False)
        for line, (_, rows) in zip(curves, by_model, strict=True):
            ends = [(distance(matrix), worst(matrix)) for matrix in jacobians(rows)]
            np.testing.assert_allclose(line.get_xydata(), ends, atol=1e-6)
            found += [sigma for _, sigma in ends]
        return found
    seven = [one for one in RECORDS if one.trusted and one.jacobian.shape == (6, 7)]
    proved = bound("max-min", arm("unit-revolute", 7)).value
    found = [np.sqrt(1 / 3), proved, *(worst(one.jacobian) for one in seven)]
    if name == "singular-values":
        values = table[table["locked_joint"].notna()].groupby("jacobian")["value"].min()
        for value in values:
            assert min(abs(value - sigma) for sigma in found) < 1e-12
    return found


@pytest.mark.parametrize("name", FIGURES)
def test_every_number_shown_is_that_of_the_jacobians_drawn(drawn, name):
    picture = drawn[name]
    allowed = recomputed(name, picture)
    shown = re.findall(r"\d+\.\d+", " ".join(texts(picture.figure)))
    assert shown
    for text in shown:
        room = 0.5001 * 10.0 ** -len(text.partition(".")[2])
        assert min(abs(float(text) - value) for value in allowed) <= room, text


def test_starts_that_did_not_converge_are_counted_and_not_drawn(drawn):
    table = drawn["optima"].table
    assert table[table["start"] == 0]["counted"].sum() == 0
    assert table[table["start"] > 0]["counted"].all()
    assert table.groupby("problem").size().tolist() == [2] * len(optima.PROBLEMS)
    residual = table[table["counted"] & (table["problem"] == "residual, unit lever arms")]
    np.testing.assert_allclose(residual["worst_case_sigma"], 0.519856, atol=1e-6)
    said = " ".join(texts(drawn["optima"].figure))
    assert "1 of 2 at 0.51986" in said
    assert said.count("1 fail") == len(optima.PROBLEMS)
    for axes, (_, rows) in zip(
        drawn["optima"].figure.axes, table.groupby("problem", sort=False), strict=True
    ):
        assert sum(bar.get_height() for bar in axes.patches) == rows["counted"].sum()
        assert axes.get_xlim()[1] < 0.7
