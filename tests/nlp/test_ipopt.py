"""Solutions carry Ipopt's own account and what was recomputed."""

import casadi as ca
import numpy as np
import pytest

from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Constraint, Problem
from lockedjoint.nlp.solver import Solver, solve


def circle(sense="maximise"):
    """Extreme x + y on the unit circle in the half-plane x ≥ 0.9: (√½, √½) is cut off."""
    x = ca.SX.sym("x", 2)
    limits = (
        Constraint("circle", ca.sumsqr(x), 1, 1),
        Constraint("half-plane", x[0], 0.9, np.inf),
    )
    return Problem("circle", x, ca.sum1(x), sense, constraints=limits, outputs={"twice": 2 * x})


def test_maximum_and_minimum_against_the_closed_form():
    solution = solve(circle(), [1.0, 0.1])
    expected = np.array([0.9, np.sqrt(1 - 0.81)])
    assert solution.status.return_status == "Solve_Succeeded"
    assert solution.status.success
    np.testing.assert_allclose(solution.variables, expected, atol=1e-7)
    np.testing.assert_allclose(solution.outputs["twice"].ravel(), 2 * expected, atol=1e-7)
    assert solution.objective == pytest.approx(expected.sum(), abs=1e-7)
    assert solution.violation < 1e-7
    assert solution.status.iterations > 0

    other = solve(circle("minimise"), [1.0, -0.1])
    assert other.sense == "minimise"
    assert other.objective == pytest.approx(0.9 - np.sqrt(1 - 0.81), abs=1e-7)


def test_multipliers_satisfy_stationarity():
    """∇f + Σ λ∇g = 0 for the minimised −(x + y)."""
    solution = solve(circle(), [1.0, 0.1])
    x, y = solution.variables
    (circle_multiplier,) = solution.multipliers["circle"]
    (plane_multiplier,) = solution.multipliers["half-plane"]
    gradient = -np.ones(2) + circle_multiplier * 2 * np.array([x, y])
    gradient[0] += plane_multiplier
    np.testing.assert_allclose(gradient, 0, atol=1e-6)


def test_failure_is_a_result():
    x = ca.SX.sym("x")
    impossible = Problem("p", x, x**2, constraints=(Constraint("c", x**2, -1.0, -1.0),))
    solution = solve(impossible, [1.0])
    assert solution.status.return_status == "Infeasible_Problem_Detected"
    assert not solution.status.success
    assert solution.violation == pytest.approx(1.0, abs=1e-4)


def test_the_violation_is_recomputed_and_not_the_solvers():
    x = ca.SX.sym("x")
    far = (Constraint("c", x, 5.0, np.inf),)
    far = Problem("p", x, x, constraints=far, lower=-10, upper=10)
    stopped = solve(far, [0.0], {"max_iter": 0})
    assert stopped.status.return_status == "Maximum_Iterations_Exceeded"
    assert stopped.violation == pytest.approx(5 - stopped.variables[0])


def test_the_violation_counts_the_variables_bounds():
    x = ca.SX.sym("x")
    solution = solve(Problem("p", x, x, lower=0.0), [1.0], {"bound_relax_factor": 1e-2})
    assert solution.variables[0] < -5e-5
    assert solution.violation == pytest.approx(-solution.variables[0])


def test_one_solver_gives_the_same_answer_whatever_it_solved_before():
    solver, starts = Solver(circle()), np.random.default_rng(0).normal(size=(8, 2))
    alone = [solve(circle(), start).variables for start in starts]
    for way in (1, -1):
        in_turn = [solver.solve(start).variables for start in starts[::way]]
        np.testing.assert_array_equal(alone[::way], in_turn)


@pytest.mark.parametrize(
    "start", [[1.0], [1.0, np.nan], [1.0, np.inf], [[1.0, 2.0]], ["a", "b"]]
)
def test_refuses_a_bad_start(start):
    with pytest.raises((InputError, ValueError)):
        solve(circle(), start)


def test_no_option_file_of_the_working_folder_is_read(tmp_path, monkeypatch):
    (tmp_path / "ipopt.opt").write_text("max_iter 0\n")
    monkeypatch.chdir(tmp_path)
    assert solve(circle(), [1.0, 0.1]).status.success
