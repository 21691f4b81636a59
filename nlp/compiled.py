"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept in a cache
under a name made from the C code, the compiler's command and CasADi's version.

Fatrop is called from the C code itself, without CasADi in between: every function of a small
problem costs more around it than in it, where it is looked up by name, timed by the system's
clock, and Python asked for signals. It is the same Fatrop with the same options, so the
iterations are the same; a few lines here read how they ended.
"""

import atexit
import ctypes
import hashlib
import os
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import SUCCESS, Derivatives, Problem

# Straight-line code: higher levels take many times longer to compile and run no faster.
STRAIGHT = ("-O1", "-fPIC", "-shared")
# Products of matrices are loops.
LOOPS = ("-O3", "-fPIC", "-shared")
# CasADi's product of dense matrices adds to one entry at a time. With its inner loops exchanged
# the compiler works on several entries at once; each sum keeps its order.
_ENTRIES, _TERMS = "for (j=0; j<nrow_x; ++j) {", "for (k=0; k<ncol_x; ++k) {"
_DEEPER = "\n        "
_PRODUCT = (_ENTRIES + _DEEPER + _TERMS, _TERMS + _DEEPER + _ENTRIES)
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


def compiled_solver(
    program: Mapping[str, ca.SX], functions: Sequence[ca.Function], settings: Mapping[str, Any]
) -> ca.Function | None:
    """Return Fatrop, called by CasADi, with compiled functions; those of `callbacks`, or none.

    Without a compiler CasADi's own, with a warning, and None where derivatives are written out.
    """
    plain, called = None, functions
    if not functions:
        plain = ca.nlpsol("solver", "fatrop", program, settings)
        called = (plain.oracle(), *map(plain.get_function, plain.get_function()))
    library = _library(called, LOOPS if functions else STRAIGHT)
    return plain if library is None else ca.nlpsol("solver", "fatrop", str(library), settings)


def compiled_function(function: ca.Function) -> ca.Function | None:
    """Return a function as machine code; None, with a warning, without a compiler."""
    library = _library([function], STRAIGHT)
    return None if library is None else ca.external(function.name(), str(library))


def _library(
    functions: Sequence[ca.Function], flags: Sequence[str], entry: str = ""
) -> Path | None:
    """Return a library with these functions, and with an entry point in C."""
    generator = ca.CodeGenerator("callbacks")
    for function in functions:
        generator.add(function)
    code = str(generator.dump()).replace(*_PRODUCT) + entry
    return shared_library(code.encode(), flags)


def callbacks(
    written: Derivatives, program: Mapping[str, ca.SX], sign: float, solver: str
) -> tuple[ca.Function, ...]:
    """Return all functions that a solver calls, by CasADi's names and with its signatures.

    The written derivatives replace those by automatic differentiation; the program's f, to be
    minimised, is the objective times the sign. Of Ipopt's only the last two are called.
    """
    x, f, g = (program[name] for name in "xfg")
    p, point, none = ca.SX(0, 1), ca.MX.sym("x", x.numel()), ca.MX.sym("p", 0, 1)
    sigma, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    slope = ca.Function("slope", [x], [f, g, ca.densify(ca.gradient(f, x))])
    jacobian = written.jacobian or ca.Function("jacobian", [x], [ca.jacobian(g, x)])
    values = slope(point)
    steep = values[2] * sigma + jacobian(point).T @ multipliers
    own = ca.densify(written.hessian(point, sign * sigma, multipliers))
    at, full = ["x", "p"], ["x", "p", "lam_f", "lam_g"]
    if solver == "fatrop":
        own += (written.shift or 0.0) * ca.MX.eye(x.numel())
        hessian = {"grad_gamma_x": steep, "hess_gamma_x_x": own}
    else:
        hessian = {"triu_hess_gamma_x_x": ca.triu(own)}
    both = {"f": values[0], "g": values[1], "grad_gamma_x": steep, "grad_gamma_p": none}
    given = {"x": point, "p": none, "lam_f": sigma, "lam_g": multipliers}

    def function(name: str, inputs: Sequence[str], results: Mapping[str, ca.MX]) -> ca.Function:
        entries = [given[symbol] for symbol in inputs]
        return ca.Function(name, entries, list(results.values()), inputs, list(results))

    return (
        ca.Function("nlp", [x, p], [f, g], at, ["f", "g"]),
        ca.Function("nlp_f", [x, p], [f], at, ["f"]),
        ca.Function("nlp_g", [x, p], [g], at, ["g"]),
        function("nlp_grad", full, both),
        function("nlp_grad_f", at, {"grad_f_x": values[2]}),
        function("nlp_jac_g", at, {"g": values[1], "jac_g_x": jacobian(point)}),
        function("nlp_hess_l", full, hessian),
    )


def shared_library(code: bytes, flags: Sequence[str] = STRAIGHT) -> Path | None:
    """Return the library made of C code; None, with a warning, if there cannot be one."""
    chosen = os.environ.get("CC")
    why = "there is no C compiler; set CC to one"
    try:
        candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
        compiler = next((one for one in candidates if one and shutil.which(one[0])), None)
        if compiler is not None:
            return _compile(code, [*compiler, *flags])
    except subprocess.CalledProcessError as reason:
        why = f"the C compiler failed with status {reason.returncode}"
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
    except ValueError as reason:  # of a quotation without an end, or a NUL
        why = f"CC is no command ({str(reason).lower()})"
    warnings.warn(f"Not compiled: {why}.", RuntimeWarning, stacklevel=3)
    return None


def _compile(code: bytes, command: Sequence[str]) -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    # The folder is the user's own, and may be emptied at any time.
    folder = (Path(base) if base else Path.home() / ".cache") / "lockedjoint"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = folder.resolve()
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    name = f"{hashlib.sha256(key).hexdigest()[:32]}.so"
    if who := others_in(folder):
        _note(f"the cache {folder} is not used: {who}")
        folder = _private_folder()
    library = folder / name
    if library.exists():
        who = others_in(library)
        if not who:
            return library
        _note(f"{library} is compiled afresh: {who}")
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        source, built = Path(scratch, "callbacks.c"), Path(scratch, "callbacks.so")
        source.write_bytes(code)
        build = [*command, "-o", str(built), str(source), "-lm"]
        # In a session of its own: a Ctrl-C is for us, and not a failure of the compiler.
        subprocess.run(build, check=True, capture_output=True, start_new_session=True)
        built.chmod(0o700)  # whatever the user's mask is
        built.replace(library)  # at once: no process ever finds a part of it
    return library


def others_in(path: Path) -> str:
    """Return in words who but this user can change a file or folder; empty if nobody can.

    Whoever can write to a folder can put another in the place of what is in it. The path has
    no symbolic links but the last part, which must be none.
    """
    if not hasattr(os, "getuid"):  # Windows: a user's folders are the user's own
        return ""
    for place in (path, *path.parents):
        about = place.lstat()
        if stat.S_ISLNK(about.st_mode):
            return f"{place} is a symbolic link"
        # Folders above may be root's, who can do anything anyhow.
        if about.st_uid != os.getuid() and (about.st_uid or place == path):
            return f"{place} belongs to another user"
        # In a sticky folder, as /tmp, nobody replaces what is another's.
        shared = about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if shared and (place == path or not about.st_mode & stat.S_ISVTX):
            return f"other users can write to {place}"
    return ""


def _note(sentence: str) -> None:
    warnings.warn(f"Compiled code: {sentence}.", RuntimeWarning, stacklevel=5)


@cache
def _private_folder() -> Path:
    """Return a folder that nobody else can write to, until this process ends."""
    folder = tempfile.mkdtemp(prefix="lockedjoint-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).resolve()


class Generated:
    """Fatrop for one problem, as compiled C code; see `generated`."""

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

    The functions are those of `callbacks`, none where no derivatives are written out.
    """
    most = int(settings["fatrop"].get("max_iter", 0))
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
        library = _library((solver, value), flags, entry)
    if library is None:
        return None
    try:
        for name in ("libblasfeo.so", "libfatrop.so"):  # where the code finds Fatrop
            ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
        return Generated(library, problem.size)
    except (OSError, AttributeError):
        return None
