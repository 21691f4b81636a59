"""Trees of boxes: what they exclude, and that no box is lost."""

import dataclasses

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.charts import tight_chart
from lockedjoint.formulations.bounds.lever_cells.trees import End, Nodes, census
from results.bounds.lever_centres import TRACELESS, random_frame
from tests.formulations.bounds.lever_cells.made_cells import arm, largest_lever_arm

# Half side of the cubes: small enough for some hundred boxes.
HALF = 0.05
# Squared radius of a chart that holds the cube.
SQUARED = 0.015


def chart():
    return tight_chart(arm()[:3], SQUARED)


def test_cube_around_the_axes_of_an_arm_is_excluded_below_its_lever_arms():
    found = census(chart(), 0.0798, Nodes.cube(HALF))
    assert found.left == 0
    assert found.certificates > 50
    assert found.programs >= found.ends[End.OWN]


def test_every_box_is_excluded_or_cut_in_two():
    found = census(chart(), 0.07, Nodes.cube(HALF))
    assert found.nodes == 2 * sum(found.ends.values()) - 1


def test_cube_with_an_arm_is_never_excluded():
    assert largest_lever_arm(arm()[6]) < 0.103
    found = census(chart(), 0.103, Nodes.cube(0.002), seconds=2.0)
    assert found.left > 0


def test_boxes_outside_the_chart_need_no_proof():
    far = dataclasses.replace(Nodes.cube(0.1), t=np.full((1, 6), 0.3))
    found = census(chart(), 0.103, far)
    assert found.ends == {End.OUTSIDE: 1}


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
