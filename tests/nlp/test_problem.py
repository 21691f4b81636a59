"""A problem says at once what is wrong with it."""

import casadi as ca
import numpy as np
import pytest

from lockedjoint.nlp.problem import Constraint, Problem


def test_bounds_default_to_none_and_are_read_only():
    problem = Problem("p", x := ca.SX.sym("x", 2), ca.sumsqr(x))
    assert np.all(np.isneginf(problem.lower))
    assert np.all(np.isposinf(problem.upper))
    with pytest.raises(ValueError, match="read-only"):
        problem.lower[0] = 1.0


def test_a_scalar_bound_holds_for_every_row():
    block = Constraint("c", ca.SX.sym("x", 3), -1.0, 2.0)
    np.testing.assert_array_equal(block.lower, [-1, -1, -1])
    np.testing.assert_array_equal(block.upper, [2, 2, 2])
