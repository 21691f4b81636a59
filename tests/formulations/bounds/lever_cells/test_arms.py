"""Arms in a region: what trees exclude, that no arm is lost, and that signs are conventions."""

import dataclasses

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.arms import arms_excluded
from lockedjoint.formulations.bounds.lever_cells.centres import SIGNS, Centres, HalfSpaces
from lockedjoint.formulations.bounds.lever_cells.nodes import Nodes
from lockedjoint.formulations.bounds.lever_cells.regions import End, Region
from results.bounds.lever_centres import TRACELESS, random_frame
from tests.formulations.bounds.lever_cells.made_cells import arm, largest_lever_arm

# Half side of the cubes: small enough for some hundred boxes.
HALF = 0.05
# Radius of a ball that holds the cube.
RADIUS = 0.12
# Signs of the null vector of the arm, which is positive.
PLUS = 0
# Other signs.
OTHER = 21


def region():
    """The whole ball around the axes of the arm, as if no other image were near."""
    made = Region.of(Centres.of_frames([arm()[:3]], RADIUS), 0)
    return dataclasses.replace(made, half_spaces=HalfSpaces(np.zeros((0, 7, 7))))


def with_signs(of, signs):
    """A region with signs at the columns of all its frames, in the same coordinates."""
    chart = dataclasses.replace(of.chart, W=of.chart.W * signs, F=of.chart.F * signs)
    return dataclasses.replace(of, chart=chart, P=chart.W.T @ chart.W)


def test_cube_around_the_axes_of_an_arm_is_excluded_below_its_lever_arms():
    found = arms_excluded(region(), 0.0798, Nodes.cube(HALF, PLUS))
    assert found.left == 0
    assert found.certificates > 50
    assert found.programs >= found.ends[End.OWN]


def test_every_box_is_excluded_or_cut_in_two():
    found = arms_excluded(region(), 0.07, Nodes.cube(HALF, PLUS))
    assert found.left == 0
    assert found.nodes == 2 * sum(found.ends.values()) - 1


@pytest.mark.parametrize("number", [PLUS, OTHER])
def test_cube_with_an_arm_is_never_excluded(number):
    assert largest_lever_arm(arm()[6]) < 0.103
    assert (arm()[6] > 0).all()
    calls = iter(range(12))
    found = arms_excluded(
        with_signs(region(), SIGNS[number]),
        0.103,
        Nodes.cube(0.002, number),
        stop=lambda: next(calls) == 11,
    )
    assert found.left > 0


def test_boxes_outside_the_chart_need_no_proof():
    far = dataclasses.replace(Nodes.cube(0.1, PLUS), t=np.full((1, 6), 0.3))
    found = arms_excluded(region(), 0.103, far)
    assert +found.ends == {End.OUTSIDE: 1}
    assert (found.nodes, found.left) == (1, 0)


def test_signs_of_the_columns_change_nothing_if_the_null_vector_has_them():
    # a box with signs is the box of a frame whose columns have these signs
    plain = arms_excluded(region(), 0.0798, Nodes.cube(HALF, PLUS))
    signed = with_signs(region(), SIGNS[OTHER])
    assert arms_excluded(signed, 0.0798, Nodes.cube(HALF, OTHER)) == plain


def test_random_frames_are_tight_and_weights_vary():
    rng = np.random.default_rng(2)
    frames, weights = zip(*(random_frame(rng) for _ in range(5)), strict=True)
    for frame in frames:
        assert np.abs(frame @ frame.T - np.eye(3)).max() < 1e-12
        assert np.abs((frame**2).sum(0) - 3 / 7).max() < 1e-12
    assert max(weights) > 1.05 * min(weights) > 0


def test_basis_of_traceless_matrices_is_orthonormal():
    flat = TRACELESS.reshape(5, 9)
    assert flat @ flat.T == pytest.approx(np.eye(5))
    assert np.trace(TRACELESS, axis1=1, axis2=2) == pytest.approx(0.0)
