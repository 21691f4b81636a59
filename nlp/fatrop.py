"""Fatrop, as compiled C code.

Fatrop takes problems without bounds, and without constraints unless their derivatives are
written out for it. Its linear algebra is dense and written for small blocks, where Ipopt's is
sparse and general: with tens of variables the same iterations take a third of the time.

Problems without constraints are solved by C code as a whole, without CasADi in between: every
function of a small problem costs more around it than in it, where it is looked up by name,
timed by the system's clock, and Python asked for signals. It is the same Fatrop with the same
options, so the iterations are the same. For other problems CasADi calls Fatrop, and Fatrop
calls compiled functions.
"""

import ctypes
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.calls import Call, CasadiCall, Ended
from lockedjoint.nlp.compiled import LOOPS, STRAIGHT, library_of
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import INVALID, SUCCESS, Problem

# Largest number of iterations of a solver that nothing interrupts while it runs. So many
# iterations of a small problem take 0.2 s.
_MOST_ITERATIONS = 10_000
# The entry point: Fatrop would not end from a start at which the objective is not finite.
# The names are those of CasADi's code generator, checked with 3.8.2; pyproject.toml allows
# 3.6.7 and later. If CasADi renames them, this code does not compile or load, and CasADi calls
# Fatrop instead. Braces are doubled for `str.format`. What `ended` holds: whether the objective
# is finite at the start, whether Fatrop succeeded, its return flag, the number of iterations.
_ENTRY = """
CASADI_SYMBOL_EXPORT
void solve_from(const casadi_real* start, casadi_real* found, int* ended) {{
  static const casadi_real* arg[{arg}];
  static casadi_real* res[{res}];
  static casadi_int iw[{iw}];
  static casadi_real w[{w}];
  static int memory = -1;
  casadi_real value = 0;
  if (memory < 0) memory = solver_checkout();
  arg[0] = start; res[0] = &value;
  value_at(arg, res, iw, w, 0);
  ended[0] = isfinite(value);
  if (!ended[0]) return;
  for (int k = 0; k < {inputs}; k++) arg[k] = 0;
  for (int k = 0; k < {outputs}; k++) res[k] = 0;
  arg[0] = start; res[0] = found;
  solver(arg, res, iw, w, memory);
  ended[1] = casadi_f0_mem[memory].success;
  ended[2] = casadi_f0_mem[memory].return_status;
  ended[3] = casadi_f0_mem[memory].stats.iterations_count;
}}
"""


def check_for_fatrop(problem: Problem) -> None:
    """Raise InputError if Fatrop does not take a problem, or if CasADi comes without it."""
    bounded = np.any(np.isfinite(problem.lower)) or np.any(np.isfinite(problem.upper))
    # A shift says that Fatrop converges with these derivatives.
    suited = problem.derivatives is not None and problem.derivatives.shift is not None
    if bounded or (problem.constraints and not suited):
        allowed = (
            "problems without constraints or bounds, or those without bounds whose derivatives "
            "are written out for it; ipopt takes all"
        )
        raise InputError("solver", f"fatrop for {problem.name}", allowed)
    if not ca.has_nlpsol("fatrop"):
        raise InputError("solver", "fatrop", "ipopt; this CasADi comes without Fatrop")


def fatrop_call(
    problem: Problem,
    program: Mapping[str, ca.SX],
    functions: Sequence[ca.Function],
    settings: Mapping[str, Any],
    bounds: FloatArray,
) -> Call:
    """Return the call of Fatrop; for the parameters see `ipopt.ipopt_call`.

    Raises
    ------
    InputError
        If derivatives are written out and cannot be compiled.
    """
    if (whole := _generated(problem, program, functions, settings)) is not None:
        return whole
    if (solver := _compiled_solver(program, functions, settings)) is not None:
        return _FatropCall(solver, bounds, problem.size)
    allowed = "ipopt; fatrop takes this problem's derivatives compiled only"
    raise InputError("solver", f"fatrop for {problem.name}", allowed)


def _status(success: bool, flag: object) -> str:
    """Return the status of Fatrop, which only says whether it converged."""
    return SUCCESS if success else f"Fatrop_Return_Flag_{flag}"


class _FatropCall(CasadiCall):
    """Fatrop, called by CasADi."""

    needs_values = True

    def ended(self) -> Ended:
        """Return how Fatrop ended."""
        ended = super().ended()
        return ended._replace(return_status=_status(ended.success, ended.return_status))


def _compiled_solver(
    program: Mapping[str, ca.SX], functions: Sequence[ca.Function], settings: Mapping[str, Any]
) -> ca.Function | None:
    """Return Fatrop, called by CasADi, with compiled functions.

    For the parameters see `ipopt.ipopt_call`.

    Returns
    -------
    casadi.Function or None
        The solver. Without a compiler there is a warning, and the solver calls CasADi's own
        functions; it is None where derivatives are written out.
    """
    plain, called = None, functions
    if not functions:
        plain = ca.nlpsol("solver", "fatrop", program, settings)
        called = (plain.oracle(), *map(plain.get_function, plain.get_function()))
    library = library_of(called, LOOPS if functions else STRAIGHT)
    return plain if library is None else ca.nlpsol("solver", "fatrop", str(library), settings)


class _Generated:
    """Fatrop for one problem, as compiled C code; see `_generated`."""

    needs_values = False

    def __init__(self, library: Path, size: int) -> None:
        self._start, self._found = np.zeros(size), np.zeros(size)
        self._ended = np.zeros(4, dtype=np.intc)
        # Not `CDLL`: the code has one memory, which threads must not share.
        self._run: Any = ctypes.PyDLL(str(library)).solve_from
        self._run.argtypes, self._run.restype = [ctypes.c_void_p] * 3, None
        arrays = (self._start, self._found, self._ended)
        self._addresses = [array.ctypes.data for array in arrays]

    def __call__(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the solver's point, and no multipliers: there are no constraints."""
        self._start[:] = self._found[:] = start
        self._ended[:] = 0
        self._run(*self._addresses)
        return self._found.copy(), np.zeros(0)

    def ended(self) -> Ended:
        """Return how it ended; there are no statistics of the iterations."""
        finite, success, flag, iterations = self._ended.tolist()
        if not finite:
            return Ended(INVALID, 0, {}, success=False)
        return Ended(_status(bool(success), flag), iterations, {}, bool(success))


def _generated(
    problem: Problem,
    program: Mapping[str, ca.SX],
    functions: Sequence[ca.Function],
    settings: Mapping[str, Any],
) -> _Generated | None:
    """Return Fatrop for a problem without constraints or bounds; None where it cannot be.

    The functions are those of `callbacks`, none where no derivatives are written out.
    """
    most = int(settings["fatrop"].get("max_iter", 0))
    # The names of the libraries that are loaded below are those on Linux.
    if sys.platform != "linux" or problem.constraints or most > _MOST_ITERATIONS:
        return None
    folder = Path(ca.__file__).parent
    known = {"cache": {function.name(): function for function in functions}}
    solver = ca.nlpsol("solver", "fatrop", program, {**settings, **known})
    value = ca.Function("value_at", [program["x"]], [program["f"]])
    entry = _ENTRY.format(
        arg=max(solver.sz_arg(), value.sz_arg()),
        res=max(solver.sz_res(), value.sz_res()),
        iw=max(solver.sz_iw(), value.sz_iw()),
        w=max(solver.sz_w(), value.sz_w()),
        inputs=solver.n_in(),
        outputs=solver.n_out(),
    )
    flags = (*(LOOPS if functions else STRAIGHT), "-I", str(folder / "include"))
    with warnings.catch_warnings():
        # The usual way says why it cannot compile either.
        warnings.filterwarnings("ignore", "Not compiled")
        library = library_of((solver, value), flags, entry)
    if library is None:
        return None
    try:
        for name in ("libblasfeo.so", "libfatrop.so"):  # where the code finds Fatrop
            ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
        return _Generated(library, problem.size)
    except (OSError, AttributeError):
        return None
