"""The solvers by name agree; compiled callbacks are made once, and are never needed."""

import os
import re
import shutil
import subprocess
import sys
import warnings
from unittest.mock import Mock

import casadi as ca
import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.nlp import compiled, fatrop
from lockedjoint.nlp.errors import InputError, SolverOptionError
from lockedjoint.nlp.problem import INVALID, Constraint, Derivatives, Problem, Stage
from lockedjoint.nlp.solver import Solver
from lockedjoint.nlp.starts import Task


def rosenbrock():
    x = ca.SX.sym("x", 2)
    f = (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2
    return Problem("rosenbrock", x, f, outputs={"x": x})


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    return tmp_path / "lockedjoint"


@pytest.mark.parametrize("name", ["ipopt", pytest.param("fatrop", marks=pytest.mark.compiler)])
def test_all_solve_and_say_so(name):
    solution = Solver(rosenbrock(), {}, name).solve([-1.0, 2.0])
    assert solution.status.success
    assert solution.status.iterations > 0
    np.testing.assert_allclose(solution.variables, [1, 1], atol=1e-6)
    np.testing.assert_allclose(solution.outputs["x"].ravel(), solution.variables)
    short = Solver(rosenbrock(), {"max_iter": 3}, name).solve([-1.0, 2.0])
    assert not short.status.success


@pytest.mark.compiler
def test_compiled_once_and_by_content(cache, monkeypatch):
    run = Mock(side_effect=subprocess.run)
    monkeypatch.setattr(compiled.subprocess, "run", run)
    for problem, compilations in ((rosenbrock, 1), (rosenbrock, 1), (steep, 2)):
        Solver(problem(), {}, "fatrop")
        assert run.call_count == compilations
    assert len(list(cache.iterdir())) == 2, "libraries only, nothing half-made"


@pytest.mark.parametrize(
    ("command", "said"),
    [("no-such-cc", "no C compiler"), ("false", "failed"), ('"', "CC is no command")],
)
def test_falls_back_with_a_warning(command, said, cache, monkeypatch):
    monkeypatch.setenv("CC", command)
    with pytest.warns(RuntimeWarning, match=said):
        solver = Solver(rosenbrock(), {}, "fatrop")
    assert solver.solve([-1.0, 2.0]).status.success
    with (
        pytest.warns(RuntimeWarning, match=said),
        pytest.raises(InputError, match="compiled only"),
    ):
        Solver(steep(), {}, "fatrop")
    assert not cache.exists() or not list(cache.iterdir())


def loaded(problem):
    """Whether a problem is solved by compiled code, and what was said, if anything was."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        solver = Solver(problem, {}, "fatrop")
    assert solver.solve([-1.0, 2.0]).status.success
    return [str(one.message) for one in said]


def by_mode(path):
    path.chmod(0o777)


def by_owner(path):
    os.chown(path, 12345, 12345)


def by_link(path):
    other = path.with_name("elsewhere.so")
    path.rename(other)
    path.symlink_to(other)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache with the code of one problem, to be copied: it is compiled once."""
    home = tmp_path_factory.mktemp("filled")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(home))
        patch.delenv("CC", raising=False)
        assert loaded(rosenbrock()) == []
    return home / "lockedjoint"


@pytest.mark.compiler
@pytest.mark.parametrize("what", ["file", "folder", "above"])
@pytest.mark.parametrize("opened", [by_mode, by_owner, by_link])
def test_code_that_others_can_change_is_not_run(cache, filled, what, opened):
    """Whoever can write to the cache, or put another folder in its place, could run code."""
    if opened is by_owner and os.getuid():
        pytest.skip("only root can give files away")
    if opened is by_link and what != "file":
        pytest.skip("links to folders are the user's own")
    shutil.copytree(filled, cache)
    assert loaded(rosenbrock()) == []
    [library] = cache.iterdir()
    kept = library.read_bytes()
    # What another put there is code that the machine does not know.
    library.unlink()  # this process has the old one in use
    library.write_bytes(b"\x7fELF of somebody else")
    opened({"file": library, "folder": cache, "above": cache.parent}[what])
    said = loaded(rosenbrock())
    assert said, "a note"
    assert all(re.search("is not used|compiled afresh", one) for one in said)
    if what == "file":
        assert library.read_bytes()[:4] == kept[:4]
        assert not library.is_symlink()
        assert library.stat().st_mode & 0o777 == 0o700
        assert loaded(rosenbrock()) == []
    else:
        assert library.read_bytes().startswith(b"\x7fELF of somebody")


def test_fatrop_refuses_what_it_cannot_solve():
    x = ca.SX.sym("x")
    bounded = Problem("bounded", x, x**2, lower=0.0)
    disc = Constraint("disc", x**2, -np.inf, 1.0)
    for problem in (Problem("disc", x, x**2, constraints=(disc,)), bounded):
        with pytest.raises(InputError, match="without constraints or bounds"):
            Solver(problem, name="fatrop")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("snopt", {}), "one of ipopt, fatrop"),
        (("fatrop", {"mu": 1}), "one of max_iter, tol"),
        (("fatrop", {"tol": 0}), "a number above 0"),
        (("fatrop", {"max_iter": 1.5}), "a whole number above 0"),
        (("fatrop", {"max_iter": 2**40}), "a whole number above 0"),
    ],
)
def test_refuses_unknown_solvers_and_options(arguments, said):
    solver, options = arguments
    with pytest.raises((InputError, SolverOptionError), match=said):
        Task(rosenbrock, None, options, None, solver)


def test_a_constraint_that_is_not_a_number_is_a_violation_that_is_not():
    """Log of a negative number at a start that stays where it is: NaN, not 0."""
    x = ca.SX.sym("x")
    log = Constraint("log", ca.log(-1 - x**2), -np.inf, np.inf)
    solution = Solver(Problem("nan", x, x**2, constraints=(log,)), {"max_iter": 1}).solve([1.0])
    assert np.isnan(solution.violation)


def test_a_start_that_is_stuck_after_the_first_stage_is_tried_by_itself():
    """log x from where the first stage ends, x = −1, has no value."""
    x = ca.SX.sym("x")
    first = Stage(Problem("first", x, (x + 1) ** 2), 5)
    problem = Problem("log", x, x - ca.log(x), first=first)
    solution = Solver(problem).solve([3.0])
    assert solution.variables == pytest.approx([1.0])
    ended = [one.return_status for one in (*solution.earlier, solution.status)]
    assert ended == ["Solve_Succeeded", "Invalid_Number_Detected", "Solve_Succeeded"]


def test_the_first_stage_may_be_the_answer():
    x = ca.SX.sym("x")
    first = Stage(Problem("first", x, (x - 2) ** 2), 5, lambda point: abs(point[0] - 2) < 1e-9)
    problem = Problem("second", x, (x - 2) ** 4, first=first, outputs={"twice": 2 * x})
    solution = Solver(problem).solve([3.0])
    assert solution.status.iterations == 1
    assert solution.earlier == ()
    assert solution.problem == "second"
    assert solution.outputs["twice"] == pytest.approx(4.0)


def steep():
    """Exponential, with its own Hessian: infinite from x = 1000 on."""
    x, z, sigma, none = ca.SX.sym("x"), *(ca.MX.sym(name, *shape) for name, shape in SHAPES)
    hessian = ca.Function("hessian", [z, sigma, none], [sigma * ca.exp(z)])
    return Problem("steep", x, ca.exp(x) - x, derivatives=Derivatives(hessian, shift=0.0))


SHAPES = (("z", (1,)), ("sigma", (1,)), ("lambda", (0,)))


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere Fatrop is called through CasADi")
@pytest.mark.compiler
@pytest.mark.parametrize("make", [rosenbrock, steep])
def test_generated_code_takes_the_same_steps_as_casadi(make, monkeypatch):
    starts = np.random.default_rng(1).normal(size=(5, make().size))
    direct = Solver(make(), {}, "fatrop")
    assert isinstance(direct._call, fatrop._Generated)
    monkeypatch.setattr("lockedjoint.nlp.fatrop._generated", lambda *_: None)
    usual = Solver(make(), {}, "fatrop")
    assert not isinstance(usual._call, fatrop._Generated)
    for start in starts:
        one, two = direct.solve(start), usual.solve(start)
        assert one.status.return_status == two.status.return_status == "Solve_Succeeded"
        assert one.status.iterations == two.status.iterations > 0
        np.testing.assert_array_equal(one.variables, two.variables)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere Fatrop is called through CasADi")
@pytest.mark.compiler
def test_generated_code_says_how_it_ended():
    short = Solver(rosenbrock(), {"max_iter": 3}, "fatrop").solve([-1.0, 2.0])
    assert short.status.return_status == "Fatrop_Return_Flag_1"
    assert 3 <= short.status.iterations <= 4  # it counts the last one, too
    solver = Solver(steep(), {}, "fatrop")
    lost = solver.solve([1000.0])
    assert (lost.status.return_status, lost.status.iterations) == (INVALID, 0)
    assert lost.variables == [1000.0]
    assert solver.solve([1.0]).status.success, "the next start is not affected"


@pytest.mark.compiler
def test_what_could_run_for_long_is_called_through_casadi():
    """Where signals are heard."""
    solver = Solver(rosenbrock(), {"max_iter": 10**6}, "fatrop")
    assert not isinstance(solver._call, fatrop._Generated)
    assert solver.solve([-1.0, 2.0]).status.success


@pytest.mark.parametrize("encoding", ["two-stage", "schur-complement"])
@pytest.mark.parametrize("order", ["first-order", "second-order", "only-second-order"])
def test_derivatives_are_tested_where_functions_have_values(encoding, order):
    """Not at a point that Ipopt draws far from the start: there it ended in an exception."""
    options = {"derivative_test": order, "print_level": 0}
    outcome = lj.solve(
        "max-min",
        lj.arm("unit-revolute", 7),
        starts=1,
        workers=1,
        encoding=encoding,
        options=options,
    )
    assert set(outcome.status_counts) == {"Solve_Succeeded"}
