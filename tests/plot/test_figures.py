"""Figures of the paper's robots and of 7R arms show what NumPy finds in the Jacobian."""

import numpy as np
import pandas as pd
import pytest

from formulations import max_min
from formulations.joints.models import arm
from formulations.plot import optima, planar, seven_axes, singular_values, trade_off
from formulations.plot.picture import NothingFoundError, Request
from formulations.reproduction import reference
from nlp.errors import InputError
from nlp.starts import generator


def sampled(model, seed):
    joints = arm(model, 7)
    return joints.jacobian(joints.sample(generator(seed, seed)))


def words(figure):
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    texts += [axes.get_title(side) for axes in figure.axes for side in ("left", "right")]
    return " | ".join([*texts, figure.get_suptitle()])


def test_figure_1_shows_four_robots_with_the_columns_of_eq_12():
    table = planar.figure_1(Request(starts=2)).table
    assert len({tuple(np.round(lengths, 3)) for lengths in table["link_lengths"]}) == 4
    for x, y in (np.transpose(joints) for joints in table["joint_positions"]):
        columns = np.array([y, -x])  # z × (p − a), the end effector p at the origin
        for column in reference.PLANAR_3R.T:
            assert (
                min(np.linalg.norm(columns.T - s * column, axis=1).min() for s in (1, -1))
                < 1e-6
            )


def test_printed_forms_whatever_frame_order_and_signs():
    """Eq. (12), and α of eq. (16)."""
    rng = np.random.default_rng(7)
    for _ in range(5):
        frame, alpha = rng.uniform(0, 2 * np.pi), rng.uniform(0, np.pi / 2)
        mixed = planar.turned(reference.PLANAR_3R, frame)[:, rng.permutation(3)]
        printed = planar.printed_form(mixed * rng.choice([-1, 1], 3))
        np.testing.assert_allclose(printed, reference.PLANAR_3R, atol=1e-9)
        member = planar.turned(reference.planar_4r(alpha)[:2], frame)[:, [0, 2, 3, 1]]
        assert planar.alpha(planar.in_family(member)) == pytest.approx(alpha, abs=1e-9)


def test_figure_3_shows_members_of_the_family_of_eq_16():
    """Two locked joints are best at odd multiples of 45 degrees."""
    table = planar.figure_3(Request(starts=30)).table
    assert len(table) == 8
    for matrix, degrees in zip(table["jacobian"], table["alpha_degrees"], strict=True):
        printed = -reference.planar_4r(np.radians(degrees))[:2]  # upside down
        np.testing.assert_allclose(matrix, printed, atol=1e-6)
    best = table["optimal_for_locked"] == 2
    np.testing.assert_allclose(table["alpha_degrees"][best] % 90, 45, atol=1e-3)
    np.testing.assert_allclose(table["sigma_two_locked"][best], np.sin(np.pi / 8), atol=1e-6)
    assert (table["sigma_two_locked"][~best] < 0.38).all()
    np.testing.assert_allclose(table["sigma_one_locked"], np.sqrt(0.5), atol=1e-6)


def test_only_starts_that_pass_the_gate_are_drawn(monkeypatch):
    """A start that stops early may have the largest σ of all, with too large a ‖J‖."""
    monkeypatch.setattr(max_min, "OPTIONS", {"max_iter": 2})
    with pytest.raises(NothingFoundError):
        planar.optima(4, Request(starts=5))


def test_seven_axes_touch_the_sphere_and_are_drawn_in_full():
    picture = seven_axes.make(Request(starts=2))
    points, ways = (np.array(picture.table[k].tolist()) for k in ("nearest_point", "direction"))
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-7)
    np.testing.assert_allclose(np.sum(points * ways, axis=1), 0, atol=1e-7)
    for panel in picture.figure.axes:
        assert {text.get_text() for text in panel.texts} == set("0123456")
        (left, right), (low, high) = panel.get_xlim(), panel.get_ylim()
        assert len(panel.collections) == 7
        for piece in (piece for line in panel.collections for piece in line.get_segments()):
            assert ((piece > [left, low]) & (piece < [right, high])).all()


def test_a_jacobian_with_other_distances_is_said_to_have_them():
    matrix = sampled("lever-revolute", 0)
    picture = seven_axes.make(Request(starts=1, jacobian=matrix))
    assert "tangent" not in words(picture.figure)
    np.testing.assert_allclose(
        picture.table["distance"], np.linalg.norm(matrix[:3], axis=0), atol=1e-12
    )


def test_singular_values_are_those_of_the_matrix_without_each_joint():
    matrix = np.random.default_rng(5).normal(size=(3, 5))
    picture = singular_values.make(Request(starts=1, jacobian=matrix))
    table = picture.table
    for joint in (None, *range(5)):
        left = matrix if joint is None else np.delete(matrix, joint, axis=1)
        own = table["locked_joint"].isna() if joint is None else table["locked_joint"] == joint
        np.testing.assert_allclose(
            table["value"][own] ** 2, np.linalg.eigvalsh(left @ left.T)[::-1]
        )
    bound = np.sqrt(np.sum(matrix**2) / 3 * 2 / 5)
    np.testing.assert_allclose(table["bound (6)"], bound)
    assert f"{bound:.4f}" in words(picture.figure)
    drawn = [
        stroke[0, 1]
        for axes in picture.figure.axes
        for part in axes.collections
        for stroke in part.get_segments()
    ]
    for value in table["value"]:
        assert np.abs(np.array(drawn) - value).min() < 1e-12


@pytest.mark.parametrize(("model", "bounds"), [("unit-revolute", 2), ("lever-revolute", 1)])
def test_the_certified_bound_is_for_unit_revolute_joints_only(model, bounds):
    assert len(singular_values.bounds(sampled(model, 1))) == bounds


def test_free_lever_arms_do_better_than_unit_ones():
    table = trade_off.make(Request(starts=1), points=3).table
    unit, free = (table[table["model"] == f"{name}-revolute"] for name in ("unit", "lever"))
    at_unit = np.interp(
        trade_off.distance(unit["isotropy_defect"]),
        trade_off.distance(free["isotropy_defect"]),
        free["worst_case_sigma"],
    )
    assert (unit["worst_case_sigma"] < at_unit).all()


def test_a_bin_edge_does_not_split_the_starts_of_one_optimum():
    sigmas = [0.3, 0.5, 0.5, 0.5]
    edge = optima._edges(pd.Series(sigmas))[100]
    sigmas += [edge - 1e-9, edge + 1e-9]
    assert [number for _, number in optima.levels(pd.Series(sigmas))] == [3, 2, 1]
    rows = {"problem": "a", "label": "a", "counted": True, "worst_case_sigma": sigmas}
    [axes] = optima.draw(pd.DataFrame(rows)).axes
    assert [bar.get_height() for bar in axes.patches] == [1, 2, 3]
    assert "3" in [text.get_text() for text in axes.texts]  # on the highest bar


def test_starts_of_a_store_that_failed_are_counted_apart(tmp_path, monkeypatch):
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
