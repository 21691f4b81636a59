"""Each encoding says what it claims: λ_min(AAᵀ − A_F A_Fᵀ) ≥ t for every F."""

from itertools import combinations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.encodings.factors import ENCODINGS
from lockedjoint.nlp.problem import Problem
from lockedjoint.nlp.solver import solve


def smallest(matrix, columns):
    kept = np.delete(matrix, columns, axis=1)
    return np.linalg.eigvalsh(kept @ kept.T)[0]


def encode(matrix, name, failures):
    """Encode for one fixed numeric matrix: only t and the auxiliary variables are left."""
    t = ca.SX.sym("t")
    sets = list(combinations(range(matrix.shape[1]), failures))
    return t, sets, ENCODINGS[name](ca.SX(matrix), t, sets, 1e-6)


@pytest.mark.parametrize("name", ENCODINGS)
@pytest.mark.parametrize("failures", [1, 2])
def test_the_largest_level_is_the_worst_eigenvalue(name, failures):
    """Maximising t for a fixed A must give min_F λ_min: an SVD computes the same."""
    matrix = np.random.default_rng(3).normal(size=(3, 6))
    t, sets, encoded = encode(matrix, name, failures)
    truth = min(smallest(matrix, columns) for columns in sets)
    start, x = 0.5 * truth, ca.vertcat(t, encoded.variables)
    limits = {"constraints": encoded.constraints, "lower": np.append(0.0, encoded.lower)}
    problem = Problem(name, x, t, "maximise", **limits)
    solution = solve(problem, np.concatenate([[start], encoded.complete_start(matrix, start)]))
    assert solution.variables[0] == pytest.approx(truth, abs=1e-5)


@pytest.mark.parametrize("name", ENCODINGS)
@given(seed=st.integers(0, 10_000), failures=st.sampled_from([1, 2]))
def test_starts_meet_every_constraint_below_the_worst_eigenvalue(name, seed, failures):
    matrix = np.random.default_rng(seed).normal(size=(2, 5))
    t, sets, encoded = encode(matrix, name, failures)
    truth = min(smallest(matrix, columns) for columns in sets)
    point = encoded.complete_start(matrix, 0.5 * truth)
    assert np.all(point >= encoded.lower)
    # Starts are rounded away from singular.
    slack = (1e-2 if truth < 1e-2 else 1e-3) * (1 + np.abs(matrix).max() ** 2)
    for block in encoded.constraints:
        function = ca.Function("g", [t, encoded.variables], [block.expression])
        value = np.array(function(0.5 * truth, point)).ravel()
        assert np.all((block.lower - slack <= value) & (value <= block.upper + slack))


def test_shared_factor_is_violated_above_the_worst_eigenvalue():
    matrix = np.random.default_rng(5).normal(size=(3, 5))
    t, sets, encoded = encode(matrix, "shared-factor", 1)
    truth = min(smallest(matrix, columns) for columns in sets)
    level = min(1.05 * truth, 0.99 * np.linalg.eigvalsh(matrix @ matrix.T)[0])
    assert level > truth
    point = encoded.complete_start(matrix, level)
    lengths = ca.Function("g", [t, encoded.variables], [encoded.constraints[1].expression])
    assert np.max(np.array(lengths(level, point))) > 1
