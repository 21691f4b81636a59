"""Fatrop called from C code that CasADi generates, without CasADi in between.

Called through CasADi, every function of a small problem costs more around it than in it: it is
looked up by name, timed by the system's clock, asks Python for signals. The generated code is
the same interface to the same Fatrop with the same options, compiled together with the
functions, so the iterations are the same; a few lines here read how they ended.
"""

import ctypes
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from nlp.arrays import FloatArray
from nlp.compiled import LOOPS, STRAIGHT, faster_products, shared_library
from nlp.problem import Problem
from nlp.solution import SUCCESS

INVALID = "Invalid_Number_Detected"  # Ipopt's word
# While it runs nothing interrupts it: so many iterations of a small problem take 0.2 s.
_MOST_ITERATIONS = 10_000
# The entry point: Fatrop would not end from a start at which the objective is not finite.
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


class Generated:
    """Fatrop for one problem, as compiled C code; see `generated`.

    Attributes
    ----------
    library
        Where the code is.
    """

    def __init__(self, library: Path, size: int) -> None:
        self.library = library
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

    def ended(self) -> tuple[str, int, Mapping[str, Any]]:
        """Return how it ended, the number of iterations, and no statistics of these."""
        finite, success, flag, iterations = self._ended.tolist()
        if not finite:
            return INVALID, 0, {}
        return SUCCESS if success else f"Fatrop_Return_Flag_{flag}", iterations, {}


def generated(
    problem: Problem,
    program: Mapping[str, ca.SX],
    functions: Sequence[ca.Function],
    settings: Mapping[str, Any],
) -> Generated | None:
    """Return Fatrop for a problem without constraints or bounds; None where it cannot be.

    Parameters
    ----------
    problem, program
        The problem, and ``x``, ``f``, ``g`` as CasADi takes them.
    functions
        Of `nlp.compiled.callbacks`, where derivatives are written out; empty where not.
    settings
        Options of ``casadi.nlpsol``.
    """
    most = int(settings["fatrop"].get("max_iter", 0))
    if sys.platform != "linux" or problem.constraints or most > _MOST_ITERATIONS:
        return None
    folder = Path(ca.__file__).parent
    known = {"cache": {one.name(): one for one in functions}}
    solver = ca.nlpsol("solver", "fatrop", program, {**settings, **known})
    value = ca.Function("value_at", [program["x"]], [program["f"]])
    generator = ca.CodeGenerator("solver")
    for function in (solver, value):
        generator.add(function)
    both = (solver, value)
    entry = _ENTRY.format(
        arg=max(one.sz_arg() for one in both),
        res=max(one.sz_res() for one in both),
        iw=max(one.sz_iw() for one in both),
        w=max(one.sz_w() for one in both),
        inputs=solver.n_in(),
        outputs=solver.n_out(),
    )
    code = faster_products(str(generator.dump())) + entry
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the usual way says why it cannot compile either
        flags = (*(LOOPS if functions else STRAIGHT), "-I", str(folder / "include"))
        library = shared_library(code.encode(), flags)
    if library is None:
        return None
    try:
        for name in ("libblasfeo.so", "libfatrop.so"):  # where the code finds Fatrop
            ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
        return Generated(library, problem.size)
    except (OSError, AttributeError):
        return None
