"""Gauss–Newton steps in place of a solver, beside those that a solver makes."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from lockedjoint.formulations import max_min
from lockedjoint.formulations.joints import models
from lockedjoint.nlp.gauss_newton import STALLED, GaussNewton
from lockedjoint.nlp.problem import INVALID, LIMIT, SUCCESS
from lockedjoint.nlp.solver import Solver

X = ca.SX.sym("x", 2)
ROSENBROCK = ca.vertcat(10 * (X[1] - X[0] ** 2), 1 - X[0])


@pytest.mark.parametrize("joints", [7, 8, 12])
def test_steps_are_those_of_ipopt(joints):
    arm = models.arm("unit-revolute", joints, 6)
    problem = max_min.build(arm)
    first = problem.first
    assert first is not None
    by_solver = Solver(replace(problem, first=replace(first, rows=None)))
    own, rng = Solver(problem), np.random.default_rng(0)
    for _ in range(5):
        start = arm.sample(rng)
        one, other = own.solve(start), by_solver.solve(start)
        assert one.objective == pytest.approx(other.objective, abs=1e-7)
        assert one.status.success
        for mine, ipopts in zip(one.earlier, other.earlier, strict=True):
            assert mine.iterations == pytest.approx(ipopts.iterations, abs=1)


def test_rows_that_can_vanish_do():
    point, _, status = GaussNewton(X, ROSENBROCK, 200, compiled=False).run(
        np.array([-1.2, 1.0])
    )
    assert point == pytest.approx([1.0, 1.0], abs=1e-8)
    assert status.return_status == SUCCESS


def test_every_step_lowers_the_sum():
    """One step is the first of two, so that the sums of 1, 2, … steps are those on the way."""
    start, sums = np.array([-1.2, 1.0]), [24.2]
    value = ca.Function("value", [X], [ca.sumsqr(ROSENBROCK)])
    for most in range(1, 8):
        point, _, status = GaussNewton(X, ROSENBROCK, most, compiled=False).run(start)
        assert (status.return_status, status.iterations) == (LIMIT, most)
        sums.append(float(value(point)))
    assert np.all(np.diff(sums) < 0)


@pytest.mark.compiler
def test_compiled_steps_are_the_same():
    start = np.array([-1.2, 1.0])
    plain, compiled = (
        GaussNewton(X, ROSENBROCK, 5, which).run(start) for which in (False, True)
    )
    assert compiled[0] == pytest.approx(plain[0], abs=1e-12)


@pytest.mark.parametrize(
    ("rows", "ended"),
    [
        (ca.vertcat(X[0] ** 2 + 1, X[1]), STALLED),  # least at 0, and not 0 there
        (ca.vertcat(ca.log(X[0] - 1), X[1]), INVALID),
    ],
)
def test_how_it_ends_elsewhere(rows, ended):
    point, _, status = GaussNewton(X, rows, 5, compiled=False).run(np.zeros(2))
    assert status.return_status == ended
    assert not status.acceptable
    assert point == pytest.approx([0.0, 0.0])
