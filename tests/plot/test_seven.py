"""Figures of 7R arms show what NumPy finds in the Jacobian, and starts where they ended."""

import json

import numpy as np
import pandas as pd
import pytest

from formulations.joints.models import arm
from formulations.plot import optima, seven_axes, singular_values, trade_off
from formulations.plot.picture import NothingFoundError, Request
from formulations.reproduction import reference
from nlp.errors import InputError
from nlp.starts import generator


@pytest.fixture(scope="module")
def swept():
    return trade_off.make(Request(starts=1), points=3)


def words(figure):
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    titles = [axes.get_title(loc) for axes in figure.axes for loc in ("left", "center")]
    return " | ".join([*texts, *titles, figure.get_suptitle()])


def test_seven_axes_touch_the_sphere_and_are_drawn_in_full():
    picture = seven_axes.make(Request(starts=2))
    table = picture.table
    points, ways = (np.array(table[name].tolist()) for name in ("nearest_point", "direction"))
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-7)
    np.testing.assert_allclose(np.sum(points * ways, axis=1), 0, atol=1e-7)
    # The Jacobian again from the axes: its worst case is the known optimum.
    matrix = np.vstack([np.cross(points, ways).T, ways.T])
    left = [np.linalg.svd(np.delete(matrix, f, axis=1), compute_uv=False)[-1] for f in range(7)]
    assert min(left) == pytest.approx(0.571483, abs=1e-6)
    np.testing.assert_allclose(table["sigma_when_locked"], left, atol=1e-9)
    for panel in picture.figure.axes:
        assert {text.get_text() for text in panel.texts} == set("0123456")
        assert len(panel.collections) == 7
        (left_edge, right_edge), (low, high) = panel.get_xlim(), panel.get_ylim()
        for line in panel.collections:
            for piece in line.get_segments():
                assert (piece > [left_edge, low]).all()
                assert (piece < [right_edge, high]).all()
    assert "0.5715" in words(picture.figure)


def test_a_jacobian_with_other_distances_is_said_to_have_them():
    lever = arm("lever-revolute", 7)
    matrix = lever.jacobian(lever.sample(generator(0, 0)))
    picture = seven_axes.make(Request(starts=1, jacobian=matrix))
    assert "tangent" not in words(picture.figure)
    np.testing.assert_allclose(
        picture.table["distance"], np.linalg.norm(matrix[:3], axis=0), atol=1e-12
    )
    with pytest.raises(InputError, match="6 rows"):
        seven_axes.make(Request(starts=1, jacobian=reference.PLANAR_3R))


def test_singular_values_are_those_of_the_matrix_without_each_joint():
    matrix = np.random.default_rng(5).normal(size=(3, 5))
    picture = singular_values.make(Request(starts=1, jacobian=matrix))
    table = picture.table
    before = table[table["locked_joint"].isna()]["value"]
    np.testing.assert_allclose(before**2, np.linalg.eigvalsh(matrix @ matrix.T)[::-1])
    for joint in range(5):
        kept = np.delete(matrix, joint, axis=1)
        values = table[table["locked_joint"] == joint]["value"]
        np.testing.assert_allclose(values**2, np.linalg.eigvalsh(kept @ kept.T)[::-1])
    bound = np.sqrt(np.sum(matrix**2) / 3 * 2 / 5)
    np.testing.assert_allclose(table["bound (6)"], bound)
    worst = table[table["locked_joint"].notna()]["value"].min()
    assert f"{bound:.4f}" in words(picture.figure)
    assert f"{worst:.4f}" in words(picture.figure)
    upper, lower = picture.figure.axes
    strokes = [y for part in (upper, lower) for y in stroke_heights(part)]
    for value in table["value"]:
        assert min(abs(value - y) for y in strokes) < 1e-12


def stroke_heights(axes):
    return [piece[0, 1] for part in axes.collections for piece in part.get_segments()]


def test_two_optima_stand_side_by_side_with_both_bounds():
    picture = singular_values.make(Request(starts=2))
    said = words(picture.figure)
    for text in ("worst case 0.5199", "worst case 0.5715", "bound (6) 0.5774"):
        assert text in said
    certified = picture.table["certified bound"]
    assert certified.between(0.5715, np.sqrt(1 / 3)).all()
    assert picture.table.groupby("jacobian").size().tolist() == [48, 48]


def test_the_certified_bound_is_for_unit_revolute_joints_only():
    unit, lever = (arm(name, 7) for name in ("unit-revolute", "lever-revolute"))
    for one, count in ((unit, 2), (lever, 1)):
        matrix = one.jacobian(one.sample(generator(1, 1)))
        assert len(singular_values.bounds(matrix)) == count


def test_the_trade_off_has_both_curves_and_their_ends(swept):
    said = words(swept.figure)
    for text in ("0.51986", "0.57148", "0.48038", "0.57465", "0.57735"):
        assert text in said
    free = swept.table[swept.table["model"] == "lever-revolute"]
    unit = swept.table[swept.table["model"] == "unit-revolute"]
    # Unit lever arms are free lever arms of mean square one: free ones do better.
    at_unit = np.interp(
        trade_off.distance(unit["isotropy_defect"]),
        trade_off.distance(free["isotropy_defect"]),
        free["worst_case_sigma"],
    )
    assert (unit["worst_case_sigma"] < at_unit).all()
    matrix = np.array(json.loads(unit["jacobian"].iloc[1]))
    deviation = matrix @ matrix.T - 7 / 3 * np.eye(6)
    away = trade_off.distance(unit["isotropy_defect"])[1]
    assert np.linalg.norm(deviation) == pytest.approx(away)


def test_levels_count_starts_at_one_optimum():
    sigmas = pd.Series([0.5, 0.3, 0.5 - 1e-9, 0.5 - 2e-9, 0.4])
    assert [(round(s, 6), n) for s, n in optima.levels(sigmas)] == [
        (0.5, 3),
        (0.4, 1),
        (0.3, 1),
    ]


def test_a_bin_edge_does_not_split_the_starts_of_one_optimum():
    sigmas = [0.3, 0.5, 0.5, 0.5]
    edge = optima._edges(pd.Series(sigmas))[100]
    sigmas += [edge - 1e-9, edge + 1e-9]
    rows = {"problem": "a", "label": "a", "counted": True, "worst_case_sigma": sigmas}
    [axes] = optima.draw(pd.DataFrame(rows)).axes
    assert [bar.get_height() for bar in axes.patches] == [1, 2, 3]
    assert "3" in [text.get_text() for text in axes.texts]  # on the highest bar


def test_a_store_is_shown_by_what_differs_in_it(tmp_path, monkeypatch):
    with pytest.raises(InputError):
        optima.stored(tmp_path / "missing.db")
    rows = pd.DataFrame(
        {
            "problem": ["a", "a", "a", "b"],
            "label": ["a", "a", "a", "b"],
            "counted": [True, True, False, False],
            "worst_case_sigma": [0.5, 0.5, 0.1, np.nan],
        }
    )
    monkeypatch.setattr(optima, "stored", lambda _: rows)
    said = words(optima.make(Request(starts=1, store=tmp_path)).figure)
    assert "2 of 3 at 0.50000, 1 fail" in said
    assert "none of 1" in said
    rows["counted"] = False
    with pytest.raises(NothingFoundError):
        optima.make(Request(starts=1, store=tmp_path))
