"""Manipulators move as a chain of rigid bodies does."""

import numpy as np
from scipy.linalg import expm


def screw(axis, point, slides):
    """The 4×4 matrix of a joint's unit twist."""
    turn = np.cross(np.eye(3), axis)  # rows e_i × ω make the matrix of ω×
    twist = np.zeros((4, 4))
    if slides:
        twist[:3, 3] = axis
    else:
        twist[:3, :3], twist[:3, 3] = turn, np.cross(point, axis)
    return twist


def test_pose_is_the_product_of_matrix_exponentials(arm):
    q = np.random.default_rng(1).uniform(-3, 3, arm.joints)
    pose = np.eye(4)
    for i in range(arm.joints):
        pose = pose @ expm(screw(arm.directions[i], arm.points[i], arm.prismatic[i]) * q[i])
    tip = np.eye(4)
    tip[:3, 3] = arm.end_effector
    np.testing.assert_allclose(arm.pose(q), pose @ tip, atol=1e-12)


def test_many_configurations_at_once(arm):
    q = np.random.default_rng(3).uniform(-3, 3, (2, 5, arm.joints))
    many = arm.jacobian(q)
    assert many.shape == (2, 5, len(arm.task.rows), arm.joints)
    np.testing.assert_allclose(many[1, 4], arm.jacobian(q[1, 4]), atol=1e-14)


def test_another_order_and_flips_share_the_columns(arm):
    rng = np.random.default_rng(4)
    order, flips = rng.permutation(arm.joints), rng.integers(2, size=arm.joints) == 1
    other = arm.arranged(order, flips)
    free = arm.task.free_directions & ~other.prismatic
    signs = np.where(flips & ~free, -1, 1)
    np.testing.assert_allclose(other.jacobian(), signs * arm.jacobian()[:, order], atol=1e-12)
    assert np.allclose(other.points, arm.points[order]) != np.any(flips & free)
    assert other.columns == tuple(order)
    again = other.arranged(np.argsort(order), flips[np.argsort(order)])
    np.testing.assert_allclose(again.points, arm.points, atol=1e-15)
    assert again.columns == arm.columns
