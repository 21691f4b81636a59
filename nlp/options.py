"""The options of the solvers, checked before any start runs."""

import io
import json
import subprocess
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import lru_cache
from numbers import Real
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from nlp.errors import InputError, SolverOptionError

OptionValue: TypeAlias = str | int | float

# Silent, and without an ipopt.opt that happens to lie in the working folder.
QUIET: Mapping[str, OptionValue] = {"print_level": 0, "sb": "yes", "option_file_name": ""}

# Fatrop's options, and their kinds; all above 0. The last four say what is added to the Hessian
# where it is not convex: first, by what factor more until it is (the first time, later), and by
# what factor less at the next iteration.
FATROP: Mapping[str, type[OptionValue]] = {
    "max_iter": int,
    "tol": float,
    "delta_w0": float,
    "kappa_wplusem": float,
    "kappa_wplus": float,
    "kappa_wmin": float,
}

# Options that name a file to read or write, or a library to load, by solver.
FILE_OPTIONS: Mapping[str, frozenset[str]] = {
    "ipopt": frozenset({"hsllib", "option_file_name", "output_file", "pardisolib"}),
    "fatrop": frozenset(),
}

# Kinds of options of Ipopt, by the word that CasADi's message has for them.
_KINDS: Mapping[str, tuple[type[OptionValue], str]] = {
    "is_int()": (int, "an integer of 32 bits"),
    "is_double()": (float, "a real number that is finite"),
    "is_string()": (str, "a text"),
}
_LARGEST = 2**31 - 1


def check_options(
    options: Mapping[str, object], solver: str = "ipopt", allow_files: bool = False
) -> dict[str, OptionValue]:
    """Return the options, each of an existing name and an allowed type and value.

    Parameters
    ----------
    options
        The solver's own names of options, without a prefix, and their values.
    solver
        ``"ipopt"`` or ``"fatrop"``.
    allow_files
        Whether options may name files and libraries, see `FILE_OPTIONS`. Only for a caller
        who trusts the values: a library is loaded and run, a file is overwritten.

    Returns
    -------
    dict
        The values in the types that the solver takes: an integer where it wants one.

    Raises
    ------
    InputError
        If there is no such solver.
    SolverOptionError
        If the solver has no such option, the option does not take the value or names a file
        without leave, or the linear solver cannot be loaded.
    """
    if solver not in FILE_OPTIONS:
        raise InputError("solver", solver, "one of " + ", ".join(FILE_OPTIONS))
    for name in options:
        if name in FILE_OPTIONS[solver] and not allow_files:
            allowed = "options without files and libraries; Python callers set allow_files"
            raise SolverOptionError("Ipopt option", name, allowed)
    check = _fatrop_option if solver == "fatrop" else _ipopt_option
    checked = {name: check(name, value) for name, value in options.items()}
    if solver == "ipopt" and checked.get("linear_solver", "mumps") != "mumps":
        _try_linear_solver(json.dumps(checked))
    return checked


def _fatrop_option(name: str, value: object) -> OptionValue:
    if name not in FATROP:
        raise SolverOptionError("Fatrop option", name, "one of " + ", ".join(FATROP))
    number = _typed(value, FATROP[name])
    if not isinstance(number, int | float) or not 0 < number < np.inf:
        article = "a whole number" if FATROP[name] is int else "a number"
        raise SolverOptionError(f"Fatrop option {name}", value, f"{article} above 0")
    return number


def _ipopt_option(name: str, value: object) -> OptionValue:
    kind, words = _kind(name)
    given = _typed(value, kind)
    # No option takes an empty text in place of one of its settings: Ipopt then lists them.
    asked = "" if given is None and kind is str else given
    refused = "" if asked is None else _refusal(name, asked, words)
    if given is None or refused:
        raise SolverOptionError(f"Ipopt option {name}", value, refused or words)
    return given


def _typed(value: object, kind: type[OptionValue]) -> OptionValue | None:
    """Return `value` in this type; None where it has none such."""
    if kind is str:
        return value if isinstance(value, str) else None
    if not isinstance(value, Real) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    if kind is float:
        return number if np.isfinite(number) else None
    # CasADi passes larger integers on by their last 32 bits.
    return int(number) if number.is_integer() and abs(number) <= _LARGEST else None


@lru_cache(maxsize=256)
def _kind(name: str) -> tuple[type[OptionValue], str]:
    """Type of an option of Ipopt, also in words; SolverOptionError if there is no such option.

    No option takes a dictionary, and CasADi names the type that it wants instead.
    """
    error, _ = _trial(name, {})
    for word, kind in _KINDS.items():
        if word in error:
            return kind
    allowed = "the name of an option in Ipopt's option reference"
    raise SolverOptionError("Ipopt option", name, allowed)


@lru_cache(maxsize=256)
def _refusal(name: str, value: OptionValue, words: str) -> str:
    """What Ipopt allows in place of this value, at least `words`; empty if it takes it."""
    error, said = _trial(name, value)
    if not error:
        return ""
    lines = said.rstrip().splitlines()
    settings = [line.split()[0] for line in lines if line.startswith("\t")]
    if settings:
        return "one of " + ", ".join(settings)
    if not lines or "<" not in lines[-1]:
        return words
    low, _, rest = lines[-1].partition("(")  # such as 0 < (1e-08) <= +inf
    limits = f"{low}{name}{rest.partition(')')[2]}".replace("<=", "≤")
    return f"{words}, {limits}"


def _trial(name: str, value: object) -> tuple[str, str]:
    """Set Ipopt up with one option; return CasADi's error, if any, and what Ipopt printed."""
    x, printed = ca.SX.sym("x"), io.StringIO()
    settings: dict[str, Any] = {"ipopt": {**QUIET, name: value}, "print_time": False}
    with redirect_stdout(printed):  # CasADi prints through Python's standard output
        try:
            ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, settings)
        except RuntimeError as error:
            return str(error), printed.getvalue()
    return "", printed.getvalue()


@lru_cache(maxsize=16)
def _try_linear_solver(options: str) -> None:
    """Solve in another process: some linear solvers, where missing, crash theirs."""
    command = [sys.executable, "-c", _LINEAR_SOLVER_TRIAL, options]
    tried = subprocess.run(command, capture_output=True, check=False, start_new_session=True)
    if tried.returncode != 0:
        allowed = "a linear solver that this Ipopt can load; mumps always is"
        name = json.loads(options)["linear_solver"]
        raise SolverOptionError("Ipopt option linear_solver", name, allowed)


_LINEAR_SOLVER_TRIAL = """
import json, sys, casadi as ca
given = json.loads(sys.argv[1])
names = ("linear_solver", "hsllib", "pardisolib")
options = {name: given[name] for name in names if name in given}
x = ca.SX.sym("x")
solver = ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, {"ipopt": options})
solver(x0=1.0)
sys.exit(0 if solver.stats()["return_status"] == "Solve_Succeeded" else 1)
"""
