"""Figs. 1 and 3 of the paper show robots whose Jacobians are what the paper says."""

import io
from itertools import combinations

import numpy as np
import pytest

from formulations import max_min
from formulations.plot import planar
from formulations.plot.picture import NothingFoundError, Request
from formulations.plot.style import content
from formulations.reproduction import reference
from formulations.synthesis.from_jacobian import realise


def chain_jacobian(joints):
    """Columns z × (p − a) of revolute joints at a, the end effector p at the origin."""
    x, y = np.array(joints).T
    return np.array([y, -x])


@pytest.fixture(scope="module")
def first():
    return planar.figure_1(Request(starts=2))


@pytest.fixture(scope="module")
def third():
    return planar.figure_3(Request(starts=30))


def test_figure_1_shows_four_robots_with_the_columns_of_eq_12(first):
    assert len(first.table) == 4
    for joints in first.table["joint_positions"]:
        found = chain_jacobian(joints)
        for column in reference.PLANAR_3R.T:
            nearest = min(
                np.linalg.norm(sign * column - other) for other in found.T for sign in (1, -1)
            )
            assert nearest < 1e-6


def test_the_four_robots_differ_in_their_links(first):
    lengths = first.table["link_lengths"].tolist()
    for one, other in combinations(lengths, 2):
        assert np.max(np.abs(np.subtract(one, other))) > 0.5
    joints = np.array(first.table["joint_positions"].iloc[1])
    ends = np.vstack([joints, [0, 0]])
    np.testing.assert_allclose(np.linalg.norm(np.diff(ends, axis=0), axis=1), lengths[1])


def test_the_printed_form_is_eq_12_whatever_frame_order_and_signs():
    rng = np.random.default_rng(7)
    for _ in range(5):
        turn = planar.turned(reference.PLANAR_3R, rng.uniform(0, 2 * np.pi))
        mixed = turn[:, rng.permutation(3)] * rng.choice([-1, 1], 3)
        np.testing.assert_allclose(planar.printed_form(mixed), reference.PLANAR_3R, atol=1e-9)


def test_figure_3_shows_members_of_the_family_of_eq_16(third):
    assert len(third.table) == 8
    for matrix, degrees in zip(
        third.table["jacobian"], third.table["alpha_degrees"], strict=True
    ):
        printed = -reference.planar_4r(np.radians(degrees))[:2]  # upside down
        np.testing.assert_allclose(matrix, printed, atol=1e-6)


def test_two_locked_joints_are_best_at_odd_multiples_of_45_degrees(third):
    best = third.table[third.table["optimal_for_locked"] == 2]
    np.testing.assert_allclose(best["alpha_degrees"] % 90, 45, atol=1e-3)
    np.testing.assert_allclose(best["sigma_two_locked"], np.sin(np.pi / 8), atol=1e-6)
    others = third.table[third.table["optimal_for_locked"] == 1]
    assert (others["sigma_two_locked"] < 0.38).all()
    np.testing.assert_allclose(third.table["sigma_one_locked"], np.sqrt(0.5), atol=1e-6)


def test_alpha_is_recovered_from_any_frame_and_pairing():
    rng = np.random.default_rng(3)
    for _ in range(5):
        wanted = rng.uniform(0, np.pi / 2)
        matrix = planar.turned(reference.planar_4r(wanted)[:2], rng.uniform(0, 2 * np.pi))
        found = planar.alpha(planar.in_family(matrix[:, [0, 2, 3, 1]]))
        assert found == pytest.approx(wanted, abs=1e-9)


def test_joints_are_drawn_where_they_are(first):
    for axes, joints in zip(first.figure.axes, first.table["joint_positions"], strict=True):
        pins = [line.get_xydata()[0] for line in axes.lines if len(line.get_xydata()) == 1]
        for joint in joints:
            assert min(np.linalg.norm(pin - joint) for pin in pins) < 1e-12


def test_only_starts_that_pass_the_gate_are_drawn(monkeypatch):
    """A start that stops early may have the largest σ of all, with too large a ‖J‖."""
    monkeypatch.setattr(max_min, "OPTIONS", {"max_iter": 2})
    with pytest.raises(NothingFoundError):
        planar.optima(4, Request(starts=5))


def test_figures_are_the_same_bytes_again(first):
    again = planar.figure_1(Request(starts=2))
    assert content(first.figure, "svg") == content(again.figure, "svg")


def test_a_picture_is_dark_on_white_without_boxes(first):
    pillow = pytest.importorskip(
        "PIL.Image", reason='Pillow is missing: pip install ".[figures]"'
    )
    pixels = np.asarray(pillow.open(io.BytesIO(content(first.figure, "png"))).convert("L"))
    assert np.mean(pixels > 250) > 0.85
    border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert border.min() == 255


def test_optima_of_planar_arms_are_realised_exactly():
    matrix = planar.printed_form(reference.PLANAR_3R)
    places = realise(matrix).points[:, :2]
    np.testing.assert_allclose(chain_jacobian(places), matrix, atol=1e-12)
