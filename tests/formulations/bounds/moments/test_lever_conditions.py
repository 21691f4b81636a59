"""What isotropic lever arms imply for unit ones holds of true Jacobians, in every phase."""

import json
from math import cos, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.lever_conditions import (
    lever_conditions,
    lever_defect,
)
from lockedjoint.formulations.bounds.moments.rotations import random_rotations
from lockedjoint.formulations.bounds.revolute_exclusions import (
    SKEW_WEIGHT,
    SYMMETRIC_WEIGHT,
    excludes_isotropic,
    excludes_isotropic_levers,
)

COMPARISON = Path(__file__).parents[4] / "results/comparison/jacobians.json"
CONDITIONS = lever_conditions()


def best_isotropic():
    stored, kind = json.loads(COMPARISON.read_text("utf-8")), ("isotropy", "lever-revolute")
    [best] = [one["jacobian"] for one in stored if (one["formulation"], one["model"]) == kind]
    return np.array(best)


def isotropic_jacobians(count, size):
    """Isotropic revolute Jacobians with lever arms of any length, near the best known."""
    rng, best = np.random.default_rng(0), best_isotropic()

    def defects(x):
        jacobian = x.reshape(6, 7)
        v, w = np.vsplit(jacobian, 2)
        rows = (jacobian @ jacobian.T - 7 / 3 * np.eye(6))[np.triu_indices(6)]
        return np.concatenate([rows, np.sum(w**2, axis=0) - 1, np.sum(v * w, axis=0)])

    for _ in range(count):
        start = best.ravel() + size * rng.standard_normal(42)
        found = least_squares(defects, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(found.fun).max() < 1e-12
        yield found.x.reshape(6, 7)


def unit(jacobian):
    v, w = np.vsplit(jacobian, 2)
    return v / np.linalg.norm(v, axis=0), w


def enclosed(jacobian):
    return EnclosedMatrix(np.asarray(jacobian, np.longdouble)[None], np.zeros(1))


def value(condition, jacobian):
    return float(condition.values(enclosed(jacobian), None).values[0, 0, 0])


def turned(v, w, angle):
    return np.vstack([cos(angle) * v - sin(angle) * w, sin(angle) * v + cos(angle) * w])


def test_every_step_of_the_proof_at_isotropic_jacobians():
    compared = 0
    for jacobian in isotropic_jacobians(30, 0.03):
        levers = np.sum(jacobian[:3] ** 2, axis=0) - 1
        delta = levers.max()
        y = 7 * delta / (1 + delta)
        if y >= 1:
            continue
        compared += 1
        v, w = unit(jacobian)
        e_v, e_x = v @ v.T - 7 / 3 * np.eye(3), v @ w.T
        symmetric, skew = (e_x + e_x.T) / 2, (e_x - e_x.T) / 2
        beside = (1 - sqrt(1 - y)) ** 2
        assert np.sum(e_v**2) <= 2 / 3 * y**2
        assert 4 * np.sum(symmetric**2) <= 2 * beside
        assert 4 * np.sum(skew**2) <= 2 * beside
        whole = 0.5 * np.sum(e_v**2) + 4 * float(SYMMETRIC_WEIGHT) * np.sum(symmetric**2)
        whole += 4 * float(SKEW_WEIGHT) * np.sum(skew**2)
        for angle in (0.0, 0.3, 2.0):
            own = turned(v, w, angle)
            assert float(lever_defect(enclosed(own)).values[0, 0, 0]) == pytest.approx(whole)
            assert value(CONDITIONS["turned"], own) * 16 == pytest.approx(
                4 * np.sum(symmetric**2), abs=1e-10
            )
            assert value(CONDITIONS["aligned"], own) * 256 == pytest.approx(
                4 * np.sum(e_v * symmetric) ** 2, abs=1e-10
            )
        assert not excludes_isotropic_levers(whole, sqrt(1 / 3 - delta))
    assert compared > 10


def test_the_conditions_exclude_other_unit_jacobians():
    """Otherwise they would add nothing: neither holds of all Jacobians."""
    jacobian = EnclosedMatrix.jacobian(random_rotations(np.random.default_rng(1), 500, 7))
    for name, condition in CONDITIONS.items():
        values = condition.values(jacobian, None).values[:, 0, 0]
        assert condition.name == name
        assert values.min() < 0
        assert values.max() > 0 or name == "narrow"


def test_equal_weights_are_theorem_a(monkeypatch):
    from lockedjoint.formulations.bounds import revolute_exclusions

    monkeypatch.setattr(
        revolute_exclusions, "SYMMETRIC_WEIGHT", revolute_exclusions.Fraction(1, 4)
    )
    monkeypatch.setattr(revolute_exclusions, "SKEW_WEIGHT", revolute_exclusions.Fraction(1, 4))
    monkeypatch.setattr(revolute_exclusions, "LEVER_LIMIT", revolute_exclusions.Fraction(1))
    for sigma in np.linspace(0.45, 0.58, 27):
        for defect in (0.0, 0.03, 0.0568, 0.1):
            same = excludes_isotropic(defect, sigma)
            assert excludes_isotropic_levers(defect, sigma) == same


def test_error_bounds_hold_against_twice_the_precision():
    """Values in double precision beside those in extended precision."""
    rotations = random_rotations(np.random.default_rng(2), 50, 7, extended=True)
    long = EnclosedMatrix.jacobian(rotations)
    short = EnclosedMatrix(long.values.astype(float), long.errors + 1e-15)
    pairs = [(lever_defect(long), lever_defect(short))]
    pairs += [(one.values(long, None), one.values(short, None)) for one in CONDITIONS.values()]
    for exact, rounded in pairs:
        off = np.abs(exact.values - rounded.values)[:, 0, 0]
        assert np.all(off <= exact.errors + rounded.errors)
        assert np.any(off > 0)
