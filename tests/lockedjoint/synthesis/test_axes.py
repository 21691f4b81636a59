"""The axes of a Jacobian are where a point of the joint gives the column back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.joints import models as joints
from lockedjoint.formulations.reproduction import reference
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.starts import generator
from lockedjoint.synthesis.family import family
from lockedjoint.synthesis.from_jacobian import deviation, realise
from lockedjoint.synthesis.links import link_lengths
from tests.made_robots import random_revolute


def lengths(arm):
    return link_lengths(arm.points, arm.end_effector)


@given(st.integers(0, 2**32), st.floats(0.01, 100))
def test_spatial_columns_come_back(seed, lever):
    matrix = random_revolute(seed, levers=lever)
    tip = np.array([1.0, 2.0, -3.0])
    arm = realise(matrix, end_effector=tip, metres=0.5)
    levers = tip - arm.points  # v = ω × (p − a), written out
    np.testing.assert_allclose(
        np.cross(arm.directions, levers).T, 0.5 * matrix[:3], atol=1e-12 * lever
    )
    np.testing.assert_allclose(arm.directions.T, matrix[3:], atol=1e-14)
    through = tip - 0.5 * np.cross(matrix[:3], matrix[3:], axis=0).T
    np.testing.assert_allclose(arm.points, through, atol=1e-12 * lever)


def test_planar_3r_of_figure_1():
    """Eq. (12): columns 120° apart, so joints at the corners of an equilateral triangle."""
    arm = realise(reference.PLANAR_3R)
    np.testing.assert_allclose(arm.jacobian(), reference.PLANAR_3R, atol=1e-15)
    np.testing.assert_allclose(lengths(arm), np.sqrt([2, 2, 2 / 3]), rtol=1e-14)
    ways = np.diff(np.vstack([arm.points, arm.end_effector]), axis=0)[:, :2]
    headings = np.degrees(np.arctan2(ways[:, 1], ways[:, 0]))
    turns = np.abs((np.diff(headings) + 180) % 360 - 180)
    np.testing.assert_allclose(turns, [120, 150], atol=1e-9)


@pytest.mark.parametrize("alpha", [0.0, 0.3, np.pi / 4, 2.0])
def test_planar_4r_family_of_figure_3(alpha):
    """Eq. (16): joints on a circle; links from the chords between them, in closed form."""
    arm = realise(reference.planar_4r(alpha)[:2])
    chord = np.sqrt(2) * abs(np.sin(np.pi / 4 - alpha / 2))
    np.testing.assert_allclose(lengths(arm), [1, chord, 1, np.sqrt(1 / 2)], atol=1e-15)


def test_positional_4r():
    """Eq. (18): any directions of the axes realise it, all levers are √(3/4)."""
    matrix = reference.POSITIONAL_4R[:3]
    rng = np.random.default_rng(0)
    directions = np.cross(rng.standard_normal((4, 3)), matrix.T)
    for arm in (realise(matrix), realise(matrix, directions=directions)):
        np.testing.assert_allclose(arm.jacobian(), matrix, atol=1e-15)
        np.testing.assert_allclose(np.linalg.norm(arm.points, axis=1), np.sqrt(3 / 4))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(arm.directions, unit, atol=1e-15)


def test_printed_entries_need_a_tolerance_and_get_the_nearest_arm():
    with pytest.raises(InputError, match="column"):
        realise(reference.NEARLY_OPTIMAL_7R)
    arm = realise(reference.NEARLY_OPTIMAL_7R, tolerance=1e-3)
    assert 1e-6 < deviation(arm, reference.NEARLY_OPTIMAL_7R) < 1e-4


def test_prismatic_joints_slide_and_do_not_turn():
    arm = realise([[0.6, 1, 0, 2], [0.8, 1, 1, 0]], kinds="prRr")
    np.testing.assert_array_equal(arm.prismatic, [True, False, False, False])
    np.testing.assert_allclose(arm.pose([0.5, 0, 0, 0])[:2, 3], [0.3, 0.4])
    np.testing.assert_array_equal(arm.full_jacobian()[3:, 0], 0)


@pytest.mark.parametrize("length", [1.0, 2.0])
def test_lengths_and_speeds_of_the_model_are_kept(length):
    model = joints.arm("lever-revolute(length=0.3):5,prismatic(speed=0.5):2")
    matrix = model.jacobian(model.sample(generator(0, 0)))
    robot = realise(matrix, metres=length).arranged([6, 0, 1, 5, 2, 3, 4])
    scaled = np.diag([length] * 3 + [1.0] * 3) @ matrix
    np.testing.assert_allclose(robot.jacobian(), scaled[:, robot.columns], atol=1e-12)
    np.testing.assert_array_equal(robot.speeds != 1, robot.prismatic & (length == 1))
    [same] = family(robot).arms()
    np.testing.assert_allclose(same.jacobian(), robot.jacobian(), atol=1e-12)
    assert same.columns == robot.columns
    assert deviation(robot, matrix, length) < 1e-12


GOOD = random_revolute(0)


def changed(entry, value):
    matrix = GOOD.copy()
    matrix[entry] = value
    return matrix


PITCH = np.array(GOOD)
PITCH[:3, 2] += 0.1 * PITCH[3:, 2]
STILL = np.array(GOOD)
STILL[:, 2] = 0.0


@pytest.mark.parametrize(
    ("matrix", "options", "sentence"),
    [
        (PITCH, {}, "column 2 is .*pitch is neither revolute nor prismatic"),
        (changed((slice(3, 6), 4), 0.5), {}, "column 4 is .*norm 1 .revolute joint. or 0"),
        (STILL, {}, "column 2 is .*other than 0 .prismatic joint"),
        (GOOD, {"kinds": "PRRRRRR"}, "column 0 is .*rotational velocity 0"),
        (GOOD, {"kinds": "RRR"}, "kinds is RRR; allowed: 7 letters"),
        (GOOD, {"kinds": "RRRRRRX"}, "7 letters R or P"),
        (GOOD, {"space": "planar"}, "space is planar; allowed: spatial"),
        (GOOD, {"directions": np.ones((7, 3))}, "none for a spatial task"),
        (GOOD, {"metres": 0.0}, "metres is 0.0"),
        (GOOD, {"tolerance": np.nan}, "tolerance is nan"),
        (GOOD, {"end_effector": (0, 0)}, "end effector"),
        (GOOD[:4], {}, "2, 3 or 6 rows"),
        (GOOD[:3], {"directions": np.ones((2, 3))}, "7 rows of 3"),
        (GOOD[:3], {"directions": GOOD[:3].T}, "direction is .* for joint 0; .*orthogonal"),
        (GOOD[3:], {"space": "rotational", "kinds": "P" * 7}, "revolute joints only"),
        (changed((0, 0), np.inf), {}, "finite"),
        (1e200 * GOOD[:3], {}, "allowed: one from 1e-70"),
        (1e50 * GOOD[:3], {}, "linear velocity is entries from .* allowed: 0, or 1e-40"),
        (5 * np.ones((2, 3)), {"metres": 1e308}, r"metres is 1e\+308; allowed: .* to 1e\+70"),
        (changed((3, 0), 1e50), {}, "rotational velocity is .* allowed: at most 1e"),
        (np.ones((2, 3000)), {}, "jacobian is of 3000 columns; allowed: at most 50"),
    ],
)
def test_what_no_joint_can_do_is_one_sentence(matrix, options, sentence):
    with pytest.raises(InputError, match=sentence):
        realise(matrix, **options)
