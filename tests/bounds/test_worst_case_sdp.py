"""The bound as a semidefinite program: against formulas, and against faulty multipliers."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from formulations.bounds.worst_case.problem import (
    LinearFact,
    WorstCase,
    free_columns,
    revolute_arm,
)
from formulations.bounds.worst_case.program import SdpBound, solve_worst_case
from nlp.errors import InputError, SolverOptionError

SIZES = [(m, n) for m in range(2, 7) for n in range(m + 1, 13)]


def assert_proved(bound: SdpBound, expected: float) -> None:
    assert bound.status == "optimal"
    # A proved upper bound lies on the safe side of the optimum, to rounding.
    assert expected * (1 - 1e-12) <= bound.eigenvalue_bound <= expected * (1 + 1e-6)
    assert bound.certificate is not None
    assert bound.certificate.residual < 1e-6
    assert bound.certificate.smallest_eigenvalue > -1e-6


@pytest.mark.parametrize(("m", "n"), SIZES)
def test_agrees_with_eq_6(m: int, n: int) -> None:
    bound = solve_worst_case(free_columns(n, m))
    assert_proved(bound, (n - m) / n)
    assert bound.primal_value == pytest.approx(n / (n - m), rel=1e-6)
    assert bound.singular_value_bound == pytest.approx(math.sqrt((n - m) / n), rel=1e-6)


@pytest.mark.parametrize("trace", [1e-9, 14.0, 1e9])
def test_any_trace(trace: float) -> None:
    assert_proved(solve_worst_case(free_columns(7, 6, trace=trace)), trace / 6 / 7)


@pytest.mark.parametrize("lever_arm", [0.1, 1.0, 3.0, 100.0])
@pytest.mark.parametrize("joints", [7, 8, 12])
def test_revolute_arms_agree_with_their_scalar_equation(joints: int, lever_arm: float) -> None:
    problem = revolute_arm(joints, lever_arm=lever_arm)
    assert problem.closed_form is not None
    assert_proved(solve_worst_case(problem), problem.closed_form)


def test_block_traces_say_more_than_the_trace_unless_blocks_are_alike() -> None:
    alike = solve_worst_case(revolute_arm(7))
    assert alike.eigenvalue_bound == pytest.approx(1 / 3, rel=1e-6)
    for lever_arm in (0.5, 2.0):
        arm = revolute_arm(7, lever_arm=lever_arm)
        free = solve_worst_case(free_columns(7, 6, trace=arm.trace))
        assert solve_worst_case(arm).eigenvalue_bound < 0.9 * free.eigenvalue_bound


def test_an_equation_without_a_formula_tightens_the_bound() -> None:
    # tr M ≤ 2, M_11 = 3 M_22, n = 4: 1/(3/2 − t) + 1/(1/2 − t) = 2/t, so t = (3 − √3)/4.
    fact = LinearFact("ratio", np.diag([1.0, -3.0]), 0.0, "equal")
    bound = solve_worst_case(WorstCase(4, 2, 2.0, (fact,)))
    assert_proved(bound, (3 - math.sqrt(3)) / 4)


def test_a_solver_cut_short_says_so_and_proves_less() -> None:
    bound = solve_worst_case(free_columns(7, 6), options={"max_iter": 3})
    assert bound.status == "user_limit"
    assert bound.eigenvalue_bound > 1 / 7 * (1 + 1e-4)


def test_contradictory_facts_are_reported() -> None:
    negative = LinearFact("impossible", np.diag([1.0, 0.0]), -1.0, "equal")
    bound = solve_worst_case(WorstCase(4, 2, 2.0, (negative,)))
    assert bound.status.startswith("infeasible")
    assert bound.primal_value in (None, math.inf)


def test_another_solver_agrees() -> None:
    bound = solve_worst_case(free_columns(7, 6), solver="SCS", options={"eps": 1e-9})
    assert_proved(bound, 1 / 7)


def test_the_result_is_plain_json() -> None:
    shown = json.loads(
        json.dumps(solve_worst_case(free_columns(7, 6)).to_dict(), allow_nan=False)
    )
    assert shown["kind"] == "numerical"
    assert shown["closed_form_eigenvalue_bound"] == pytest.approx(1 / 7)
    assert np.shape(shown["multipliers"]["matrix"]) == (12, 12)
    scaled = solve_worst_case(free_columns(7, 6, trace=14.0)).to_dict()
    assert scaled["primal_eigenvalue"] == pytest.approx(1 / 3, rel=1e-6)
    assert scaled["dual_eigenvalue"] == pytest.approx(1 / 3, rel=1e-6)
    failed = replace(
        solve_worst_case(free_columns(7, 6)), eigenvalue_bound=math.inf, multipliers=None
    )
    assert json.loads(json.dumps(failed.to_dict(), allow_nan=False))["eigenvalue_bound"] is None


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="solver is NONE"):
        solve_worst_case(free_columns(7, 6), solver="NONE")
    with pytest.raises(SolverOptionError, match="max_itre"):
        solve_worst_case(free_columns(7, 6), options={"max_itre": 3})
    with pytest.raises(InputError, match="joints is 6"):
        revolute_arm(6)
    with pytest.raises(InputError, match="lever_arm is -1"):
        revolute_arm(7, lever_arm=-1)
    with pytest.raises(InputError, match="matrices with 6 rows"):
        WorstCase(7, 6, 6.0, (LinearFact("small", np.eye(2), 1.0, "equal"),))
    with pytest.raises(InputError, match="symmetric"):
        LinearFact("skew", np.array([[0.0, 1.0], [0.0, 0.0]]), 1.0, "equal")
