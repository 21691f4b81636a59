"""Steps within limits: what is pushed outwards is taken out, and put back when it turns."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lockedjoint.kinematics.bounded_step import bounded_step
from lockedjoint.kinematics.inverse import damped_least_squares

DAMPING = 1e-3
COUNT = 300


@pytest.fixture(scope="module")
def drawn():
    """Jacobians, what is missing, and joints of which some are at a limit and one is locked."""
    rng = np.random.default_rng(3)
    matrix, missing = rng.normal(size=(3, 6, COUNT)), rng.normal(size=(3, COUNT))
    lower, upper = np.full((6, COUNT), -1.0), np.full((6, COUNT), 1.0)
    q = rng.choice([-1.0, 0.0, 0.0, 1.0], (6, COUNT))
    lower[2] = upper[2] = q[2]
    return matrix, missing, np.full(COUNT, DAMPING), q, lower, upper


def cost(matrix, missing, move):
    left = missing - np.einsum("mnb,nb->mb", matrix, move)
    return np.sum(left**2, axis=0) + DAMPING * np.sum(move**2, axis=0)


def test_no_joint_leaves_its_limits(drawn):
    *_, q, lower, upper = drawn
    move = bounded_step(*drawn)
    assert np.all(move[q <= lower] >= 0)
    assert np.all(move[q >= upper] <= 0)
    assert np.all(move[2] == 0)


def test_the_step_is_mostly_that_of_bounded_least_squares(drawn):
    """Although half of the joints are at a limit here; a solver finds the best step."""
    matrix, missing, damping, q, lower, upper = drawn
    best = np.empty(COUNT)
    for k in range(COUNT):
        rows = np.vstack([matrix[:, :, k], np.sqrt(DAMPING) * np.eye(6)])
        sides = np.append(missing[:, k], np.zeros(6))
        # Nothing is as narrow as the 1e-12 of a locked joint, which must not be empty.
        least = np.where(q[:, k] <= lower[:, k], -1e-12, -np.inf)
        most = np.where(q[:, k] >= upper[:, k], 1e-12, np.inf)
        best[k] = 2 * lsq_linear(rows, sides, (least, most)).cost
    own = cost(matrix, missing, bounded_step(*drawn))
    assert np.all(own > best * (1 - 1e-6) - 1e-9)
    assert np.mean(own < best * 1.001 + 1e-6) > 0.7
    none = np.full_like(q, np.inf)
    stopped = np.clip(q + bounded_step(matrix, missing, damping, q, -none, none), lower, upper)
    assert np.mean(own) < 0.5 * np.mean(cost(matrix, missing, stopped - q))


def test_without_limits_it_is_damped_least_squares(drawn):
    matrix, missing, damping, q, *_ = drawn
    none = np.full_like(q, np.inf)
    move = bounded_step(matrix, missing, damping, q, -none, none)
    for k in range(0, COUNT, 30):
        own = matrix[:, :, k]
        square = own @ own.T + DAMPING * np.eye(3)
        np.testing.assert_allclose(move[:, k], own.T @ np.linalg.solve(square, missing[:, k]))


def test_a_drift_is_made_beside_the_step(drawn):
    """Along directions in which nothing is missing; not outwards, and not by locked joints."""
    matrix, missing, _, q, lower, upper = drawn
    drift = 0.1 * np.random.default_rng(1).normal(size=q.shape)
    none = np.full_like(q, np.inf)
    least = np.full(COUNT, 1e-12)
    move = bounded_step(matrix, missing, least, q, -none, none, drift)
    np.testing.assert_allclose(np.einsum("mnb,nb->mb", matrix, move), missing, atol=1e-6)
    for k in range(0, COUNT, 30):
        own = matrix[:, :, k]
        along = np.eye(6) - np.linalg.pinv(own) @ own
        np.testing.assert_allclose(along @ move[:, k], along @ drift[:, k], atol=1e-6)
    move = bounded_step(matrix, missing, least, q, lower, upper, drift)
    assert np.all(move[2] == 0)
    assert np.all(move[q <= lower] >= 0)


LENGTHS = np.array([1.0, 0.8, 0.3])


def planar(target):
    """What is missing to a place of the plane, of three links."""

    def residual(which, q):
        angle = np.cumsum(q, axis=0)
        x, y = (LENGTHS[:, None] * wave(angle) for wave in (np.cos, np.sin))
        turned = [np.cumsum(part[::-1], axis=0)[::-1] for part in (-y, x)]
        tip = np.stack([x.sum(axis=0), y.sum(axis=0)])
        return target[:, which] - tip, np.stack(turned)

    return residual


def test_starts_at_their_limits_reach_more_goals():
    """Of starts with every joint at a limit, which steps that are only cut off leave there."""
    rng = np.random.default_rng(0)
    half = np.array([[1.0], [1.2], [0.5]])
    goals = rng.uniform(-half, half, (3, 400))
    nowhere = planar(np.zeros((2, 400)))
    target = -nowhere(np.arange(400), goals)[0]
    start = half * rng.choice([-1.0, 1.0], (3, 400))
    settings = {"reached": 1e-8, "damping": 1e-10, "steps": 60}
    q, reached = damped_least_squares(planar(target), start, -half, half, **settings)
    assert np.mean(reached) > 0.85
    assert np.all(np.abs(q) <= half)
    left = planar(target)(np.arange(400), q)[0]
    assert np.max(np.linalg.norm(left[:, reached], axis=0)) < 1e-8
    # Joints that were at a limit left it again.
    assert np.mean(np.abs(q[:, reached]) < half) > 0.5
