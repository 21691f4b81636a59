"""The options of the solvers, checked before any start runs.

Ipopt itself prints which options it has and which values they take. It does so in a process of
its own: it writes to standard output, and some linear solvers that are missing crash a process.
"""

import json
import math
import operator
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from numbers import Integral, Real
from typing import NamedTuple, TypeAlias

from lockedjoint.nlp.errors import SolverOptionError, of_kind, one_of

OptionValue: TypeAlias = str | int | float

#: Options with which Ipopt is silent, and reads no ipopt.opt that happens to lie in the working
#: folder.
QUIET: Mapping[str, OptionValue] = {"print_level": 0, "sb": "yes", "option_file_name": ""}

# Fatrop's options, and their kinds; all above 0. The last four say what is added to the Hessian
# where it is not convex: first, by what factor more until it is (the first time, later), and by
# what factor less at the next iteration.
_FATROP: Mapping[str, type[OptionValue]] = {
    "max_iter": int,
    "tol": float,
    "delta_w0": float,
    "kappa_wplusem": float,
    "kappa_wplus": float,
    "kappa_wmin": float,
}
# Options with which Ipopt prints what options it has.
_DOCUMENTED: Mapping[str, OptionValue] = {
    "print_options_documentation": "yes",
    "print_options_mode": "doxygen",
    "print_advanced_options": "yes",
}
# The signs between the terms of a range.
_SIGNS = {"<": operator.lt, "≤": operator.le}
# CasADi drops the higher bits of whole numbers from this size on.
_LARGEST_WHOLE = 2**31
# Real numbers of this size are refused, as if they were not finite.
_LARGEST_REAL = 1e300
# Tries to solve with Ipopt: as JSON, its options.
_TRIAL = """
import json, sys, casadi as ca
x = ca.SX.sym("x")
settings = {"ipopt": json.loads(sys.argv[1]), "print_time": False}
solver = ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, settings)
solver(x0=1.0)
print(solver.stats()["return_status"])
"""


class CheckedOptions(dict[str, OptionValue]):
    """Options that `check_options` returned; they are not checked again."""


def check_options(options: Mapping[str, object], solver: str = "ipopt") -> CheckedOptions:
    """Return the options, each of an existing name, in the type that the solver takes.

    Ipopt's may have the prefix ``resto.``. Some of them name a file to write or a library to
    load: options from an untrusted source go through `refuse_files` first.

    Raises
    ------
    InputError
        If there is no such solver.
    SolverOptionError
        If the solver has no such option, the option does not take the value, or the linear
        solver cannot be loaded.
    """
    one_of("solver", solver, ("ipopt", "fatrop"))
    of_kind("options", options, Mapping, "a mapping from names of options to values")
    if isinstance(options, CheckedOptions):
        return options
    check = _fatrop_option if solver == "fatrop" else _ipopt_option
    checked = CheckedOptions({name: check(name, value) for name, value in options.items()})
    if solver == "ipopt" and checked.get("linear_solver", "mumps") != "mumps":
        libraries = ("linear_solver", "hsllib", "pardisolib")
        loaded = {name: checked[name] for name in libraries if name in checked}
        if not _ipopt({**QUIET, **loaded}).endswith("Solve_Succeeded\n"):
            allowed = "a linear solver that this Ipopt can load, as mumps"
            raise SolverOptionError(
                "Ipopt option linear_solver", checked["linear_solver"], allowed
            )
    return checked


def refuse_files(options: Mapping[str, object]) -> None:
    """Raise SolverOptionError if an option of Ipopt names a file or a library."""
    for name in options:
        last = name.rpartition(".")[2]
        if last in ("hsllib", "option_file_name", "output_file", "pardisolib"):
            raise SolverOptionError("Ipopt option", name, "options without files and libraries")


def _fatrop_option(name: str, value: object) -> OptionValue:
    """Return the value of an option of Fatrop in the option's type; or SolverOptionError."""
    if name not in _FATROP:
        raise SolverOptionError("Fatrop option", name, "one of " + ", ".join(_FATROP))
    number, kind = _number(value), _FATROP[name]
    broken = kind is int and isinstance(number, float)
    if number is None or not 0 < number < _LARGEST_WHOLE or broken:
        article = "a whole number" if kind is int else "a number"
        raise SolverOptionError(f"Fatrop option {name}", value, f"{article} above 0")
    return kind(number)


def _ipopt_option(name: str, value: object) -> OptionValue:
    """Return the value of an option of Ipopt in the option's type; or SolverOptionError."""
    plain = name.removeprefix("resto.") if isinstance(name, str) else ""
    if plain not in _ipopt_options():
        allowed = "the name of an option in Ipopt's option reference"
        raise SolverOptionError("Ipopt option", name, allowed)
    kind, terms, allowed = _ipopt_options()[plain]
    if kind is str:
        if isinstance(value, str) and (not terms or value.lower() in terms):
            return value
    else:
        number = _number(value)
        whole = isinstance(number, int) and abs(number) < _LARGEST_WHOLE
        fits = whole if kind is int else number is not None and abs(number) < _LARGEST_REAL
        if number is not None and fits and _within(terms, number):
            return kind(number)
    raise SolverOptionError(f"Ipopt option {name}", value, allowed)


def _within(terms: Sequence[str], value: float) -> bool:
    """Whether a value is in a range, such as 0, <, x, ≤, 1; words stand for the value."""
    numbers = [value if term[0].isalpha() else float(term) for term in terms[::2]]
    signs = [_SIGNS[term] for term in terms[1::2]]
    return all(fits(*pair) for fits, pair in zip(signs, pairwise(numbers), strict=True))


class _IpoptOption(NamedTuple):
    """What Ipopt says of one of its options."""

    kind: type[OptionValue]
    terms: Sequence[str]  # settings in lower case, or a range as in `_within`
    allowed: str  # what is allowed, in words


@lru_cache(maxsize=1)
def _ipopt_options() -> Mapping[str, _IpoptOption]:
    """Return Ipopt's options by name, from the documentation that it prints."""
    known: dict[str, _IpoptOption] = {}
    for section in _ipopt(_DOCUMENTED).split("\\anchor OPT_")[1:]:
        name = section.partition("\n")[0]
        limits = re.search(r"range for this (\w+) option is (.*) and its default", section)
        if limits is None:
            if (listed := re.search(r"Possible values: (.+)", section)) is not None:
                settings = listed[1].split(", ")
            else:
                settings = re.findall(r"^ - ([^\s:*]+)", section, re.MULTILINE)
            words = "one of " + ", ".join(settings) if settings else "a text"
            known[name] = _IpoptOption(str, [setting.lower() for setting in settings], words)
            continue
        spread = limits[2].replace("&le;", "≤")
        kind = int if limits[1] == "integer" else float
        words = "an integer of 32 bits" if kind is int else "a real number that is finite"
        known[name] = _IpoptOption(kind, spread.split(), f"{words}, {spread}")
    return known


def _ipopt(options: Mapping[str, OptionValue]) -> str:
    """Return what Ipopt prints, and how it ends, with options; nothing if it crashes."""
    done = subprocess.run(
        [sys.executable, "-c", _TRIAL, json.dumps(options)],
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,  # a Ctrl-C is for the caller
    )
    return done.stdout


def _number(value: object) -> int | float | None:
    """Return a finite real number, whole ones as integers; None where it is none."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return None
    if isinstance(value, Integral):
        return int(value)
    number = float(value)
    if not math.isfinite(number):
        return None
    return int(number) if number.is_integer() else number
