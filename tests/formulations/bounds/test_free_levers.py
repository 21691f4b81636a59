"""Bounds for free lever arms: every step of their proofs at Jacobians near the optimum."""

import json
from functools import partial
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds import certified
from lockedjoint.formulations.bounds.revolute_exclusions import (
    LEVER_LIMIT,
    excludes_isotropic,
    excludes_isotropic_levers,
    excludes_max_min,
    least_excluded,
)
from lockedjoint.formulations.existence.rings import optimal_jacobian
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.registry import bound

COMPARISON = Path(__file__).parents[3] / "results/comparison/jacobians.json"
RESIDUAL = 0.0568
SEVEN = Arm.of(UnitRevolute(), 7)


def unit(jacobian):
    """J': every v_i divided by its norm."""
    return np.vstack([jacobian[:3] / np.linalg.norm(jacobian[:3], axis=0), jacobian[3:]])


def residual(jacobian):
    n = jacobian.shape[1]
    return 0.5 * np.sum((jacobian @ jacobian.T - n / 3 * np.eye(6)) ** 2)


def near_optimum(n, size, seed):
    """Revolute joints with Σ|v_i|² at most n, near an optimally failure-tolerant Jacobian."""
    rng = np.random.default_rng(seed)
    v, w = np.vsplit(optimal_jacobian(n) + size * rng.standard_normal((6, n)), 2)
    w = w / np.linalg.norm(w, axis=0)
    v = v - w * np.sum(v * w, axis=0)
    return np.vstack([v * rng.choice([1, 0.999]) * sqrt(n / np.sum(v**2)), w])


def limit_in_floats(n, eta):
    """The bound on √(2ρ) in the last line of the proof of theorem B, and its parts."""
    t, c = (n - 6) / 3 - eta, 2 + eta
    top = brentq(lambda e: 1 / (c + e) + 25 / (5 * c - e) - (n - 6) / t, 1e-12, 4 * c)
    size, kappa = sqrt(1.2) * top, (c + top) * (n / 3 + top)
    slack = n * eta + size**2 / c
    weights = sqrt(kappa) * size / 2
    levers = 2 * weights / c + sqrt(n) * eta + slack
    shift = slack + n * eta + sqrt(n) * eta * weights / c
    p = levers**2 + (1 + eta + top) * shift
    fall = (3 - levers) / (2 - levers) ** 2
    s = 0.5 * (fall * levers**2 + sqrt(1 + eta + top) * shift)
    norm = sqrt(8 / (8 - kappa)) * size
    return norm + sqrt(p**2 + 2 * s**2), (top, size, slack, weights, levers, p, s, norm)


@pytest.mark.parametrize("n", [8, 9])
@pytest.mark.parametrize("size", [1e-5, 1e-4, 4e-4])
def test_every_step_of_the_proof_at_jacobians_near_the_optimum(n, size):
    for seed in range(10):
        jacobian = near_optimum(n, size, seed)
        sigma = measures.worst_case_sigma(jacobian)
        eta, c = (n - 6) / 3 - sigma**2, n / 3 - sigma**2
        v, w = np.vsplit(jacobian, 2)
        e = jacobian @ jacobian.T - n / 3 * np.eye(6)
        u = np.sum(v**2, axis=0) - 1
        weights = 0.5 * np.einsum("af,ab,bf->f", jacobian, e, jacobian)
        r = 2 * weights / c + eta - u
        assert (r > -1e-12).all()
        hat = np.vstack([v, np.zeros_like(v)])
        half = np.einsum("f,af,bf->ab", weights, hat, jacobian) / 2
        linear = e - half - half.T
        p, lever = (1 + u) * weights - u, np.sqrt(1 + u)
        s = 0.5 * lever * weights - lever + 1
        rest = np.zeros((6, 6))
        rest[:3, :3] = (v / lever * (p / lever)) @ v.T
        rest[:3, 3:] = (v / lever * s) @ w.T
        rest[3:, :3] = rest[:3, 3:].T
        goal = unit(jacobian) @ unit(jacobian).T - n / 3 * np.eye(6)
        np.testing.assert_allclose(linear + rest, goal, atol=1e-12)
        whole, parts = limit_in_floats(n, eta)
        found = [np.linalg.eigvalsh(e)[-1], np.linalg.norm(e), r.sum()]
        found += [np.linalg.norm(weights), np.linalg.norm(u)]
        found += [np.abs(p).sum(), np.abs(s).sum(), np.linalg.norm(linear)]
        assert np.all(np.array(found) <= parts)
        assert sqrt(2 * residual(unit(jacobian))) < whole
        assert not excludes_max_min(residual(unit(jacobian)), sigma, n)


def test_the_limits_are_those_of_a_computation_in_floats():
    def isotropic(y):
        return y**2 / 3 + (1 - sqrt(1 - y)) ** 2 - RESIDUAL

    y = brentq(isotropic, 0, 1)
    eta = brentq(lambda eta: limit_in_floats(7, eta)[0] - sqrt(2 * RESIDUAL), 1e-9, 4e-4)
    for excludes, square in ((excludes_isotropic, y / (7 - y)), (excludes_max_min, eta)):
        limit = least_excluded(excludes, RESIDUAL)
        assert limit == pytest.approx(sqrt(1 / 3 - square), abs=1e-12)


@pytest.mark.parametrize(
    ("excludes", "value"), [(excludes_isotropic, 0.5371), (excludes_max_min, 0.57711)]
)
def test_a_limit_is_excluded_and_nothing_below_it(excludes, value):
    limit = partial(least_excluded, excludes)
    found = limit(RESIDUAL)
    assert found == pytest.approx(value, abs=1e-4)
    assert excludes(RESIDUAL, found)
    assert excludes(RESIDUAL, 0.578)
    for below in (found - 1e-12, 0.5, 0.1):
        assert not excludes(RESIDUAL, below)
    assert limit(0.0) == pytest.approx(sqrt(1 / 3), abs=1e-15)
    assert limit(0.0) ** 2 > 1 / 3
    assert limit(1e-4) > limit(1e-3) > found > limit(0.06)


def test_the_weighted_residual_excludes_up_to_its_limit():
    limit = float(LEVER_LIMIT)
    assert excludes_isotropic_levers(0.0, 0.578)
    y = brentq(lambda y: y**2 / 3 + 19 / 16 * (1 - sqrt(1 - y)) ** 2 - limit, 0, 1)
    top = least_excluded(excludes_isotropic_levers, 1.0)
    assert top == pytest.approx(sqrt(1 / 3 - y / (7 - y)), abs=1e-12)
    assert top == least_excluded(excludes_isotropic_levers, limit)
    assert top < least_excluded(excludes_isotropic_levers, 0.9 * limit)
    assert not excludes_isotropic_levers(1.0, top - 1e-12)
    assert not excludes_isotropic_levers(1.0, 0.1)


def test_the_best_isotropic_jacobian_meets_theorem_a():
    stored, kind = json.loads(COMPARISON.read_text("utf-8")), ("isotropy", "lever-revolute")
    [best] = [one["jacobian"] for one in stored if (one["formulation"], one["model"]) == kind]
    best = np.array(best)
    own = residual(unit(best))
    sigma = measures.worst_case_sigma(best)
    assert own > 0.1
    assert not excludes_isotropic(own, sigma)
    assert excludes_isotropic(3 * own, sigma)
    assert sigma < bound("isotropy", arm("lever-revolute", 7)).value < 0.5375


def test_the_bounds_are_for_the_arms_for_which_they_are_proved(monkeypatch):
    kind = bound("residual", SEVEN).kind
    free = bound("isotropy", arm("lever-revolute", 7))
    assert (kind, free.kind) == ("proved (tight)", certified.LEVER_CELLS)
    assert free.value < least_excluded(excludes_isotropic, bound("residual", SEVEN).value)
    for length in (1.0, 3.0):
        assert bound("isotropy", Arm.of(LeverRevolute(length), 7)) == free
    # The mean of |v|² is 1 where J is isotropic.
    assert bound("isotropy", Arm.of(LeverRevolute(0.999), 7)) is certified.NONE_EXISTS
    mixed = Arm((*[UnitRevolute()] * 6, LeverRevolute()))
    worst = bound("max-min", mixed)
    assert worst.value == least_excluded(excludes_max_min, bound("residual", SEVEN).value)
    assert worst == bound("max-min", arm("lever-revolute-each", 7))
    for other in (Arm.of(LeverRevolute(1.01), 7), Arm((*[LeverRevolute()] * 6, Prismatic()))):
        assert bound("max-min", other).kind == "proved (relaxation)"
    assert bound("isotropy", other).kind == "closed form"
    assert bound("isotropy", arm("lever-revolute", 8)).kind == "closed form"
    assert bound("isotropy", arm("lever-revolute", 7), failures=2).value == 0
    monkeypatch.setattr(certified, "_rows", lambda _: ())
    plain = bound("isotropy", arm("lever-revolute", 7))
    assert plain.kind == "closed form"
    assert plain.value == pytest.approx(measures.sigma_bound(6, 7, 14), rel=1e-11)
