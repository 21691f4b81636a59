"""The options of the solvers, checked before any start runs.

Ipopt itself is asked which options it has and which values they take, in a process of its own:
what is wrong with one it prints to standard output, and some linear solvers, where they are
missing, crash their process.
"""

import io
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import lru_cache
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from nlp.errors import InputError, SolverOptionError, one_of

OptionValue: TypeAlias = str | int | float

# Silent, and without an ipopt.opt that happens to lie in the working folder.
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
# Kinds of options of Ipopt, by the word that CasADi's message has for them.
_KINDS: Mapping[str, tuple[type[OptionValue], str]] = {
    "is_int()": (int, "an integer of 32 bits"),
    "is_double()": (float, "a real number that is finite"),
    "is_string()": (str, "a text"),
}


class CheckedOptions(dict[str, OptionValue]):
    """Options that `check_options` returned; they are not checked again."""


def check_options(options: Mapping[str, object], solver: str = "ipopt") -> CheckedOptions:
    """Return the options, each of an existing name and an allowed type and value.

    Parameters
    ----------
    options
        The solver's own names of options and their values; Ipopt's also with the prefix of a
        part of it, such as ``resto.``. Some of Ipopt's name a file to write or a library to
        load: options from an untrusted source go through `refuse_files` first.
    solver
        ``"ipopt"`` or ``"fatrop"``.

    Returns
    -------
    CheckedOptions
        The values in the types that the solver takes: an integer where it wants one.

    Raises
    ------
    InputError
        If there is no such solver.
    SolverOptionError
        If the solver has no such option, the option does not take the value, or the linear
        solver cannot be loaded.
    """
    one_of("solver", solver, ("ipopt", "fatrop"))
    if not isinstance(options, Mapping):
        raise InputError("options", options, "a mapping from names of options to values")
    if isinstance(options, CheckedOptions):
        return options
    if solver == "fatrop":
        return CheckedOptions({name: _fatrop_option(name, options[name]) for name in options})
    plain = {}
    for name, value in options.items():
        if not isinstance(name, str):
            raise SolverOptionError("Ipopt option", name, "a text")
        plain[name] = value if isinstance(value, str) else _number(value)
        if plain[name] is None:
            raise SolverOptionError(f"Ipopt option {name}", value, "a text, or a finite number")
    return CheckedOptions(_asked(json.dumps(plain)) if plain else {})


def refuse_files(options: Mapping[str, object]) -> None:
    """Raise SolverOptionError if an option of Ipopt names a file or a library."""
    for name in options:
        last = name.rpartition(".")[2]
        if last in ("hsllib", "option_file_name", "output_file", "pardisolib"):
            raise SolverOptionError("Ipopt option", name, "options without files and libraries")


def _number(value: object) -> int | float | None:
    """Return a number as JSON has it, whole ones as integers; None where it is none."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return None
    if isinstance(value, Integral):
        return int(value)
    number = float(value)
    if not np.isfinite(number):
        return None
    return int(number) if number.is_integer() else number


def _fatrop_option(name: str, value: object) -> OptionValue:
    if name not in _FATROP:
        raise SolverOptionError("Fatrop option", name, "one of " + ", ".join(_FATROP))
    number, kind = _number(value), _FATROP[name]
    if number is None or not 0 < number < 2**31 or (kind is int and isinstance(number, float)):
        article = "a whole number" if kind is int else "a number"
        raise SolverOptionError(f"Fatrop option {name}", value, f"{article} above 0")
    return kind(number)


@lru_cache(maxsize=64)
def _asked(options: str) -> dict[str, OptionValue]:
    """Return Ipopt's options, a JSON object, as Ipopt takes them."""
    folders = filter(None, [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH")])
    done = subprocess.run(
        [sys.executable, "-c", "from nlp.options import _answer; _answer()"],
        input=options,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
        start_new_session=True,  # a Ctrl-C is for the caller
        env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
    )
    try:
        answer = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):  # it crashed: so do some linear solvers
        name = json.loads(options).get("linear_solver", "mumps")
        answer = ["linear_solver", name, "a linear solver that this Ipopt can load, as mumps"]
    if isinstance(answer, list):
        name, value, allowed = answer
        raise SolverOptionError(f"Ipopt option {name}".strip(), value, allowed)
    return dict(answer)


def _answer() -> None:
    """Read options as JSON; print them checked, or name, value and what is allowed.

    For a process of its own; see `_asked`.
    """
    given: dict[str, OptionValue] = json.load(sys.stdin)
    checked: dict[str, OptionValue] = {}
    wrong: tuple[str, object, str]
    for name, value in given.items():
        # No option takes a dictionary, and CasADi names the type that it wants instead.
        error = _trial({name: {}})[0]
        kind, words = next((kind for word, kind in _KINDS.items() if word in error), (str, ""))
        if not words:
            wrong = "", name, "the name of an option in Ipopt's option reference"
            break
        typed = _typed(value, kind)
        if typed is None or _trial({name: typed})[0]:
            wrong = name, value, _allowed(name, typed, words)
            break
        checked[name] = typed
    else:
        if checked.get("linear_solver", "mumps") != "mumps":
            names = ("linear_solver", "hsllib", "pardisolib")
            _trial({name: checked[name] for name in names if name in checked}, solve=True)
        print(json.dumps(checked))
        return
    print(json.dumps(wrong))


def _typed(value: OptionValue, kind: type[OptionValue]) -> OptionValue | None:
    """Return `value` in this type; None where it has none such."""
    if isinstance(value, str) or kind is str:
        return value if isinstance(value, str) and kind is str else None
    if kind is float:
        return float(value) if abs(value) < 1e300 else None
    # CasADi passes larger integers on by their last 32 bits.
    return value if isinstance(value, int) and abs(value) < 2**31 else None


def _allowed(name: str, tried: OptionValue | None, words: str) -> str:
    """What Ipopt allows in place of a value of the right type, or of None."""
    # No option takes an empty text in place of one of its settings: Ipopt then lists them.
    lines = _trial({name: "" if tried is None else tried})[1].rstrip().splitlines()
    settings = [line.split()[0] for line in lines if line.startswith("\t")]
    if settings:
        return "one of " + ", ".join(settings)
    if not lines or "<" not in lines[-1]:
        return words
    low, _, rest = lines[-1].partition("(")  # such as 0 < (1e-08) <= +inf
    return f"{words}, {low}{name}{rest.partition(')')[2]}".replace("<=", "≤")


def _trial(options: Mapping[str, object], solve: bool = False) -> tuple[str, str]:
    """Set Ipopt up with options; return CasADi's error, if any, and what Ipopt printed.

    A linear solver that cannot be loaded shows when it is to solve, and ends this process.
    """
    import casadi as ca

    x, printed = ca.SX.sym("x"), io.StringIO()
    settings: dict[str, Any] = {"ipopt": {**QUIET, **options}, "print_time": False}
    with redirect_stdout(printed):  # CasADi prints through Python's standard output
        try:
            solver = ca.nlpsol("trial", "ipopt", {"x": x, "f": x**2}, settings)
        except RuntimeError as error:
            return str(error), printed.getvalue()
        if solve:
            solver(x0=1.0)
            if solver.stats()["return_status"] != "Solve_Succeeded":
                sys.exit(1)
    return "", printed.getvalue()
