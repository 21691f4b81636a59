"""Ipopt's own list of its options, and options checked against it before any solve."""

from __future__ import annotations

import difflib
import html
import io
import re
import subprocess
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from nlp.errors import SolverOptionError

OptionValue: TypeAlias = str | int | float

_ENTRY = re.compile(
    r"\\anchor OPT_(?P<name>\S+)\n.*?<blockquote>\n(?P<text>.*?)</blockquote>", re.DOTALL
)
_NUMBER = re.compile(
    r"The valid range for this (?P<kind>real|integer) option is (?P<range>.*?) and "
)
_SETTING = re.compile(r"^ - (?P<setting>.+?)(?:: .*)?$", re.MULTILINE)


@dataclass(frozen=True)
class Option:
    """One option of Ipopt: its kind ('real', 'integer', 'string') and what it takes."""

    name: str
    kind: str
    allowed: str
    settings: tuple[str, ...]

    def check(self, value: object) -> OptionValue:
        """Return `value` in the type Ipopt wants, or raise SolverOptionError."""
        if self.kind == "string":
            if isinstance(value, str) and ("*" in self.settings or value in self.settings):
                return value
        elif isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
            number = float(value)
            whole = self.kind == "real" or number.is_integer()
            if whole and _in_range(self.allowed, number):
                return number if self.kind == "real" else int(number)
        raise SolverOptionError(f"Ipopt option {self.name}", value, self.allowed)


def check_options(options: Mapping[str, object]) -> dict[str, OptionValue]:
    """Return the options, each of an existing name and an allowed type and value.

    Parameters
    ----------
    options
        Ipopt's option names, without a prefix, and their values.

    Raises
    ------
    SolverOptionError
        If Ipopt has no such option, the option does not take the value, or the linear
        solver is not part of this Ipopt.
    """
    known = ipopt_options()
    checked = {}
    for name, value in options.items():
        if name not in known:
            raise SolverOptionError("Ipopt option", name, _similar(name, tuple(known)))
        checked[name] = known[name].check(value)
    if "linear_solver" in checked:
        _check_linear_solver(str(checked["linear_solver"]))
    return checked


@lru_cache(maxsize=1)
def ipopt_options() -> Mapping[str, Option]:
    """Every option of the installed Ipopt, as that Ipopt documents it."""
    text = _documentation()
    return {
        entry["name"]: _parse(entry["name"], entry["text"]) for entry in _ENTRY.finditer(text)
    }


def _parse(name: str, text: str) -> Option:
    number = _NUMBER.search(text)
    if number is None:
        listed = text.partition("Possible values:")[2]
        settings = tuple(m["setting"] for m in _SETTING.finditer(listed)) or ("yes", "no")
        allowed = "any text" if "*" in settings else "one of " + ", ".join(settings)
        return Option(name, "string", allowed, settings)
    kind = number["kind"]
    limits = html.unescape(re.sub(r"10<sup>(.*?)</sup>", r"1e\1", number["range"]))
    article = "a real number" if kind == "real" else "an integer"
    return Option(name, kind, f"{article}, {limits}", ())


def _in_range(allowed: str, value: float) -> bool:
    """Whether `value` fits limits such as '0 < tol', '0 ≤ name ≤ 1' or 'unrestricted'."""
    if np.isnan(value):
        return False
    limits = re.split(r"\s*(<|≤)\s*", allowed.partition(", ")[2])
    if len(limits) < 3:
        return True
    for left, sign, right in zip(limits[:-2:2], limits[1::2], limits[2::2], strict=True):
        low, high = _limit(left, value), _limit(right, value)
        if low > high or (sign == "<" and low == high):
            return False
    return True


def _limit(text: str, value: float) -> float:
    try:
        return float(text)
    except ValueError:  # the option's own name stands for its value
        return value


def _similar(name: str, known: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(name, known, n=3)
    hint = f", such as {', '.join(near)}" if near else ""
    return f"an option in Ipopt's option reference{hint}"


@lru_cache(maxsize=16)
def _check_linear_solver(name: str) -> None:
    """Try the linear solver in a process of its own: some, when missing, crash theirs."""
    if name == "mumps":
        return
    trial = subprocess.run(
        [sys.executable, "-c", _LINEAR_SOLVER_TRIAL, name], capture_output=True, check=False
    )
    if trial.returncode != 0:
        allowed = "a linear solver that this Ipopt can load; mumps always is"
        raise SolverOptionError("Ipopt option linear_solver", name, allowed)


_LINEAR_SOLVER_TRIAL = """
import sys, casadi as ca
x = ca.SX.sym("x")
solver = ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, {"ipopt.linear_solver": sys.argv[1]})
solver(x0=1.0)
sys.exit(0 if solver.stats()["return_status"] == "Solve_Succeeded" else 1)
"""


def _documentation() -> str:
    """Return Ipopt's documentation of its options, which it prints when asked to solve."""
    x = ca.SX.sym("x")
    settings: dict[str, Any] = {
        "print_options_documentation": "yes",
        "print_advanced_options": "yes",
        "print_options_mode": "doxygen",
    }
    output = io.StringIO()
    with redirect_stdout(output):  # CasADi prints through Python's standard output
        solver = ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, {"ipopt": settings})
        solver(x0=1.0)
    return output.getvalue()
