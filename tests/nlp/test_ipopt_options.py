"""Options are checked against what the installed Ipopt itself documents."""

import pytest

from nlp.errors import InputError, SolverOptionError
from nlp.options import check_options, ipopt_options


def test_knows_kinds_ranges_and_settings():
    known = ipopt_options()
    assert len(known) > 200
    assert known["tol"].kind == "real"
    assert known["max_iter"].kind == "integer"
    assert {"mumps", "ma57"} <= set(known["linear_solver"].settings)
    assert known["timing_statistics"].settings == ("yes", "no")


def test_values_come_back_in_the_type_ipopt_wants():
    checked = check_options({"max_iter": 50.0, "tol": 1, "mu_strategy": "adaptive"})
    assert checked == {"max_iter": 50, "tol": 1.0, "mu_strategy": "adaptive"}
    assert isinstance(checked["max_iter"], int)
    assert isinstance(checked["tol"], float)


@pytest.mark.parametrize(
    ("option", "value", "allowed"),
    [
        ("tol", 0, "0 < tol"),
        ("tol", float("nan"), "a real number"),
        ("tol", True, "a real number"),
        ("tol", "1e-9", "a real number"),
        ("max_iter", -5, "an integer, 0 ≤ max_iter"),
        ("max_iter", 3.7, "an integer"),
        ("mumps_pivtol", 2, "≤ 1"),
        ("mu_strategy", "weird", "one of monotone, adaptive"),
        ("linear_solver", "foo", "mumps"),
        ("timing_statistics", "maybe", "one of yes, no"),
    ],
)
def test_refuses_values(option, value, allowed):
    with pytest.raises(SolverOptionError) as caught:
        check_options({option: value})
    assert option in str(caught.value)
    assert allowed in str(caught.value)


def test_a_misspelt_option_is_met_with_the_right_one():
    with pytest.raises(InputError, match="max_iter"):
        check_options({"max_itr": 3})


@pytest.mark.parametrize("name", ["ma86", "ma97"])
def test_a_linear_solver_that_cannot_be_loaded_is_refused(name):
    """Ipopt lists HSL's solvers, which come as a library of their own; ma97 would crash."""
    with pytest.raises(SolverOptionError, match=name):
        check_options({"linear_solver": name})


def test_nothing_reaches_standard_output(capfd):
    ipopt_options.cache_clear()
    ipopt_options()
    with pytest.raises(SolverOptionError):
        check_options({"linear_solver": "ma77"})
    assert capfd.readouterr().out == ""
