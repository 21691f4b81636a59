"""First statement: residual minimisation."""

from functools import partial

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import measures, residual
from lockedjoint.formulations.isotropy_equations import independent_rows, pairs, residuals
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.solver import solve

UNIT_7R = arm("unit-revolute", 7)


@given(st.sampled_from([5, 7]), st.integers(0, 10_000))
def test_residuals_are_entries_of_the_deviation(joints, seed):
    for built in (Arm.of(FreeColumn(4), joints), Arm.of(LeverRevolute(), joints + 2)):
        symbols = built.symbols()
        point = built.sample(np.random.default_rng(seed))
        rows = np.array(ca.Function("f", [symbols], [residuals(built, symbols)])(point)).ravel()
        jacobian = built.jacobian(point)
        m, _ = built.shape
        gram = jacobian @ jacobian.T
        expected = gram - np.trace(gram) / m * np.eye(m)
        np.testing.assert_allclose(rows, [expected[i, j] for i, j in pairs(m)], atol=1e-12)


def test_the_order_of_the_21_residuals_is_that_of_eqs_23_to_43():
    assert pairs(6)[:7] == [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (0, 1)]
    assert pairs(6)[16] == (2, 4)  # f_17, v_z and ω_y
    assert len(pairs(6)) == 21


@pytest.mark.parametrize(
    ("built", "count"),
    [
        (UNIT_7R, 18),
        (arm("lever-revolute", 7), 19),
        (arm("free", 7), 20),
        (arm("free", 4, 3), 5),
        # tr vvᵀ = 8 and tr ωωᵀ = 7 contradict isotropy: a row more, to say so
        (Arm((UnitRevolute(),) * 7 + (Prismatic(),)), 19),
    ],
    ids=str,
)
def test_independent_equations(built, count):
    """18 = 4 + 14 for unit revolute joints (Section 4); 19 when |v| is free."""
    rows = independent_rows(built)
    assert len(rows) == count
    if built is UNIT_7R:
        assert sum(row < 6 for row in rows) == 4


@given(st.integers(0, 10_000))
def test_both_weightings_are_what_they_say(seed):
    point = UNIT_7R.sample(np.random.default_rng(seed))
    jacobian = UNIT_7R.jacobian(point)
    for weighting, measure in (
        ("invariant", measures.isotropy_defect),
        ("paper", measures.residual_sum_of_squares),
    ):
        problem = residual.build(UNIT_7R, weighting)
        value = ca.Function("f", [problem.variables], [problem.objective])(point)
        assert float(value) == pytest.approx(measure(jacobian), rel=1e-9)


def test_seven_revolute_joints_always_reach_the_paper_s_minimum():
    study = multistart(partial(residual.build, UNIT_7R), UNIT_7R.sample, starts=25, rng=11)
    jacobians = [run.solution.outputs["jacobian"] for run in study.results]
    defects = list(map(residual.score, jacobians))
    assert defects == pytest.approx([0.0568265457] * 25, abs=1e-9)
    assert len(group_equivalent(jacobians)) == 1


def test_at_the_minimum_the_whole_defect_is_in_the_hermitian_part():
    """Eigenvalues of JJᵀ come in pairs and Σ z_i z_iᵀ = 0."""
    solution = solve(residual.build(UNIT_7R), UNIT_7R.sample(np.random.default_rng(0)))
    jacobian = solution.outputs["jacobian"]
    eigenvalues = np.linalg.eigvalsh(jacobian @ jacobian.T)
    expected = [2.16869, 2.16869, 2.32575, 2.32575, 2.50556, 2.50556]
    np.testing.assert_allclose(eigenvalues, expected, atol=1e-5)
    z = jacobian[:3] + 1j * jacobian[3:]
    np.testing.assert_allclose(z @ z.T, 0, atol=1e-7)


@pytest.mark.parametrize(
    "built", [arm("unit-revolute", 8), arm("free", 5, 3), arm("free-mean", 3, 2)], ids=str
)
def test_zero_where_isotropic_jacobians_exist(built):
    solution = solve(residual.build(built), built.sample(np.random.default_rng(2)))
    assert measures.isotropy_defect(solution.outputs["jacobian"]) < 1e-12


def test_the_minimum_is_one_to_an_independent_optimiser():
    """SciPy's trust-region least squares on residuals from `measures` alone agrees."""
    optimize = pytest.importorskip("scipy.optimize", reason="SciPy is missing: pip install .")
    rows = [(i, j, np.sqrt(0.5) if i == j else 1.0) for i, j in pairs(6)]

    def weighted(point):
        gram = (jacobian := UNIT_7R.jacobian(point)) @ jacobian.T - 7 / 3 * np.eye(6)
        return np.array([weight * gram[i, j] for i, j, weight in rows])

    start = UNIT_7R.sample(np.random.default_rng(3))
    answer = optimize.least_squares(weighted, start, xtol=1e-14, ftol=1e-14, gtol=1e-12)
    ours = solve(residual.build(UNIT_7R), start)
    assert 2 * answer.cost == pytest.approx(ours.objective, abs=1e-8)
