"""Options are tried on the installed Ipopt before any start runs."""

import pytest

from lockedjoint.nlp.errors import SolverOptionError
from lockedjoint.nlp.options import check_options, refuse_files


def test_values_come_back_in_the_type_ipopt_wants():
    checked = check_options({"max_iter": 50.0, "tol": 1, "mu_strategy": "adaptive"})
    assert checked == {"max_iter": 50, "tol": 1.0, "mu_strategy": "adaptive"}
    assert isinstance(checked["max_iter"], int)
    assert isinstance(checked["tol"], float)


@pytest.mark.parametrize(
    ("option", "value", "allowed"),
    [
        ("tol", 0, "0 < tol"),
        ("tol", float("nan"), "that is finite"),
        ("tol", True, "that is finite"),
        ("tol", "1e-9", "a real number"),
        ("max_iter", -5, "an integer of 32 bits, 0 ≤ max_iter"),
        ("max_iter", 3.7, "an integer"),
        ("max_iter", 2**32 + 1, "an integer of 32 bits"),
        ("max_iter", float("inf"), "an integer of 32 bits"),
        ("tol", 10**400, "a real number"),
        ("tol", None, "that is finite"),
        ("mumps_pivtol", 2, "≤ 1"),
        ("mu_strategy", 3, "one of monotone, adaptive"),
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


@pytest.mark.parametrize("name", ["max_itr", "", "ipopt.max_iter", "OUTPUT_FILE", 3])
def test_an_option_that_does_not_exist_is_refused(name):
    with pytest.raises(SolverOptionError, match="Ipopt option is"):
        check_options({name: 3})


@pytest.mark.parametrize("name", ["hsllib", "option_file_name", "output_file", "pardisolib"])
@pytest.mark.parametrize("prefix", ["", "resto."])
def test_files_and_libraries_are_refused_where_options_are_not_trusted(name, prefix):
    with pytest.raises(SolverOptionError, match="without files and libraries"):
        refuse_files({prefix + name: "written"})
    refuse_files({"max_iter": 3})


@pytest.mark.parametrize("name", ["ma86", "ma97"])
def test_a_linear_solver_that_cannot_be_loaded_is_refused(name):
    """Ipopt lists HSL's solvers, which come as a library of their own; ma97 would crash."""
    with pytest.raises(SolverOptionError, match=name):
        check_options({"linear_solver": name})
