"""Max-min by Schur complements: derivatives, two stages, and what it refuses."""

from functools import partial

import casadi as ca
import numpy as np
import pytest

from lockedjoint.formulations import max_min, measures, residual
from lockedjoint.formulations.encodings import schur_complement
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.solving.solve import solve
from lockedjoint.nlp.multistart import multistart

UNIT_7R = arm("unit-revolute", 7)
BEST = {7: 0.5714829681, 8: np.sqrt(2 / 3), 12: np.sqrt(2)}


class Coupled:
    """A robot in miniature: four variables move all seven columns."""

    shape, size = (6, 7), 4
    bounds = np.full(4, -np.inf), np.full(4, np.inf)
    fixed_trace = 14.0

    def symbols(self):
        return ca.SX.sym("q", 4)

    def matrix(self, variables):
        mixed = np.random.default_rng(3).normal(size=(21, 4))
        return UNIT_7R.matrix(ca.SX(mixed) @ variables)

    def constraints(self, _):
        return ()

    def sample(self, rng):
        return rng.normal(size=4)


ARMS = {
    "unit revolute": UNIT_7R,
    "lever, prismatic": arm("lever-revolute:5,prismatic:3", 8),
    "planar": arm("free", 3, 2),
    "positional": arm("free-mean", 5, 3),
    "coupled": Coupled(),
}


def at_a_point(problem, one):
    """Values to differentiate at: x, σ and λ, with JJᵀ − tI positive definite."""
    rng = np.random.default_rng(5)
    x = one.sample(rng)
    rows = sum(constraint.expression.numel() for constraint in problem.constraints)
    if problem.size > one.size:
        jacobian = np.array(ca.Function("J", [v := one.symbols()], [one.matrix(v)])(x))
        x = np.append(x, 0.4 * measures.singular_values(jacobian)[-1] ** 2)
    return x, 0.7, rng.uniform(-1, 1, rows)


@pytest.mark.parametrize("one", ARMS.values(), ids=ARMS)
def test_written_derivatives_are_those_of_the_expressions(one):
    problem = schur_complement.build(one, None, {})
    z, rows = problem.variables, ca.vertcat(*(c.expression for c in problem.constraints))
    sigma, multipliers = ca.SX.sym("sigma"), ca.SX.sym("lambda", rows.numel())
    lagrangian = sigma * problem.objective + ca.dot(multipliers, rows)
    slopes = ca.Function("slopes", [z], [ca.jacobian(rows, z)])
    first, given = ca.gradient(lagrangian, z), [z, sigma, multipliers]
    gradient = ca.Function("g", given, [ca.densify(first)])
    hessian = ca.Function("h", given, [ca.jacobian(first, z)])
    x, *rest = at_a_point(problem, one)
    written = np.array(problem.derivatives.hessian(x, *rest))
    scale = np.abs(written).max()
    ours = np.array(problem.derivatives.jacobian(x))
    np.testing.assert_allclose(ours, np.array(slopes(x)), atol=1e-9)
    np.testing.assert_allclose(written, np.array(hessian(x, *rest)), atol=1e-9 * scale)
    steps = 1e-6 * np.eye(x.size)
    ends = [[np.array(gradient(x + s * h, *rest)) for s in (1, -1)] for h in steps]
    differences = [(after - before) / 2e-6 for after, before in ends]
    np.testing.assert_allclose(written, np.hstack(differences), atol=1e-5 * scale)


@pytest.mark.parametrize("one", ARMS.values(), ids=ARMS)
def test_gauss_newton_is_the_squared_derivative_of_the_residual(one):
    problem = residual.build(one, hessian="gauss-newton")
    x, m = problem.variables, one.shape[0]
    matrix = one.matrix(x)
    gram = matrix @ matrix.T
    defect = gram - ca.trace(gram) / m * ca.SX.eye(m)
    slopes = ca.jacobian(ca.vec(defect), x)
    wanted = slopes.T @ slopes + (0.1 * ca.norm_fro(defect) + 1e-8) * ca.SX.eye(one.size)
    point, _, multipliers = at_a_point(problem, one)
    found = problem.derivatives.hessian(point, 1.0, 0 * multipliers)
    expected = ca.Function("w", [x], [wanted])(point)
    np.testing.assert_allclose(np.array(found), np.array(expected), atol=1e-9)


@pytest.mark.parametrize("joints", BEST)
def test_two_stages_reach_the_best_and_keep_both_accounts(joints):
    outcome = solve(joints=joints, starts=10, workers=1)
    assert len(outcome.reached) == 10
    assert outcome.best.score == pytest.approx(BEST[joints], abs=2e-9)
    for record in outcome.records:
        stages = [*record.earlier, record.status]
        assert len(stages) == (1 if joints == 12 else len(stages)) <= 2
        assert all(one.iterations <= 12 for one in record.earlier)
        if joints == 7:
            assert [one["iterations"] for one in record.to_dict()["earlier"]] == [12]
    assert outcome.case.settings["encoding"] == "two-stage"


@pytest.mark.compiler
def test_both_stages_by_fatrop():
    build = partial(max_min.build, UNIT_7R)
    study = multistart(build, UNIT_7R.sample, starts=10, solver="fatrop")
    for run in study.results:
        sigma = measures.worst_case_sigma(run.solution.outputs["jacobian"])
        assert sigma == pytest.approx(BEST[7], abs=1e-7)
        assert run.solution.status.success
