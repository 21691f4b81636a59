"""A problem says at once what is wrong with it."""

import casadi as ca
import numpy as np
import pytest

from nlp.errors import InputError
from nlp.problem import Constraint, Problem


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


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sense": "minimize"}, "sense is minimize; allowed: one of minimise, maximise."),
        ({"lower": np.zeros(3)}, "bounds of lower is of shape"),
        ({"lower": np.array([0.0, np.nan])}, "NaN"),
        ({"lower": 1.0, "upper": 0.0}, "lower <= upper"),
        ({"objective": ca.SX.zeros(2)}, "objective is an expression of shape"),
        ({"objective": ca.SX.sym("stranger")}, "stranger"),
        ({"variables": ca.SX.sym("x", 2) + 1}, "a column of SX symbols"),
    ],
)
def test_refuses_what_makes_no_sense(change, sentence):
    x = ca.SX.sym("x", 2)
    good = {"name": "p", "variables": x, "objective": ca.sumsqr(x)}
    Problem(**good)
    with pytest.raises(InputError, match=sentence.replace("(", r"\(")):
        Problem(**{**good, **change})


def test_crossed_constraint_bounds_name_the_row():
    with pytest.raises(InputError, match=r"\[1, 0\] in row 1"):
        Constraint("c", ca.SX.sym("x", 2), np.array([0.0, 1.0]), 0.0)
