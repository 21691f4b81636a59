"""Identical manipulators, counted by the group and by comparing all of them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lockedjoint.formulations.reproduction import reference
from lockedjoint.synthesis.family import count, distinct, every, family, symmetries
from lockedjoint.synthesis.from_jacobian import realise


def planar_classes(arm):
    """Sort all arrangements by the distances between their joints and the end effector."""
    points = family(arm, every(arm)).points
    places = np.concatenate([points, np.zeros((len(points), 1, 3))], axis=1)
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1).round(6)
    return len(np.unique(apart.reshape(len(points), -1), axis=0))


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        (reference.PLANAR_3R, 4),
        (reference.planar_4r(0.0)[:2], 12),
        (reference.planar_4r(np.pi / 4)[:2], 24),
        (reference.planar_4r(0.3)[:2], 48),
        (np.random.default_rng(0).standard_normal((2, 4)), 192),
    ],
)
def test_planar_arms_by_brute_force(matrix, expected):
    arm = realise(matrix)
    group = symmetries(arm)
    assert len(distinct(every(arm), group)) == count(arm) // len(group) == expected
    assert planar_classes(arm) == expected


def test_axes_turned_about_a_line_are_a_cyclic_group():
    """Whatever the signs of the columns."""
    turns = Rotation.from_euler("z", 2 * np.pi * np.arange(7)[:, None] / 7)
    columns = np.vstack(
        [turns.apply(half).T for half in ([0.6, 0.48, 0.64], [-0.8, 0.36, 0.48])]
    )
    arm = realise(columns * [1, -1, 1, 1, -1, 1, 1])
    group = symmetries(arm)
    assert len(group) == 7
    assert len(distinct(every(arm), group)) == 720


def test_members_are_rigid_motions(arm):
    group = symmetries(arm)
    tip = arm.end_effector
    for images, flips in zip(group.orders, group.flips, strict=True):
        other = arm.arranged(images, flips)
        np.testing.assert_array_equal(other.prismatic, arm.prismatic)
        turns = ~arm.prismatic
        places = [np.vstack([one.points[turns], tip]) for one in (arm, other)]
        apart = [np.linalg.norm(one[:, None] - one, axis=-1) for one in places]
        np.testing.assert_allclose(*apart, atol=1e-5)
        angles = [np.abs(one.directions @ one.directions.T) for one in (arm, other)]
        np.testing.assert_allclose(*angles, atol=1e-5)


def test_mirror_images_are_two_manipulators():
    """Reflection in the plane z = 0 permutes these axes; no rotation does."""
    rng = np.random.default_rng(2)
    velocity, lever = rng.standard_normal((2, 3, 3))
    spin = np.cross(velocity, lever, axis=0)
    spin /= np.linalg.norm(spin, axis=0)
    mirror = np.diag([1.0, 1.0, -1.0])
    image = np.vstack([mirror @ velocity, -mirror @ spin])
    both = np.hstack([np.vstack([velocity, spin]), image])
    extra = np.array([[0, 0, 1.3, 0, 1, 0]]).T
    own = np.hstack([both, extra])
    reflected = np.vstack([mirror @ own[:3], -mirror @ own[3:]])[:, [3, 4, 5, 0, 1, 2, 6]]
    lines = [np.cross(one[3:], one[:3], axis=0) for one in (own, reflected)]
    np.testing.assert_allclose(*lines, atol=1e-12)  # the mirror image has the same axes
    assert len(symmetries(realise(own))) == 1
