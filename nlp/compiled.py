"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept in a cache
under a name made from the C code, the compiler's command and CasADi's version.
"""

import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca

from nlp.problem import Derivatives

# Straight-line code: higher levels take many times longer to compile and run no faster.
STRAIGHT = ("-O1", "-fPIC", "-shared")
# Products of matrices are loops.
LOOPS = ("-O3", "-fPIC", "-shared")
# CasADi's product of dense matrices adds to one entry at a time. With its inner loops exchanged
# the compiler works on several entries at once; each sum keeps its order.
_ENTRIES, _TERMS = "for (j=0; j<nrow_x; ++j) {", "for (k=0; k<ncol_x; ++k) {"
_DEEPER = "\n        "
_PRODUCT = (_ENTRIES + _DEEPER + _TERMS, _TERMS + _DEEPER + _ENTRIES)


def compiled_callbacks(solver: ca.Function) -> Path | None:
    """Return the library with a solver's callbacks, made if it is not in the cache.

    Parameters
    ----------
    solver
        From ``casadi.nlpsol``; build it again with the library in place of the expressions.

    Returns
    -------
    Path or None
        None, with a warning, if there is no working C compiler or no safe place to keep it.
    """
    generator = ca.CodeGenerator("callbacks")
    generator.add(solver.oracle())
    for name in solver.get_function():
        generator.add(solver.get_function(name))
    return shared_library(str(generator.dump()).encode())


def compiled_functions(functions: Sequence[ca.Function]) -> Path | None:
    """Return the library with these functions, as `compiled_callbacks`."""
    generator = ca.CodeGenerator("callbacks")
    for function in functions:
        generator.add(function)
    return shared_library(faster_products(str(generator.dump())).encode(), LOOPS)


def faster_products(code: str) -> str:
    """Return CasADi's code with products of matrices that a compiler can vectorise."""
    return code.replace(*_PRODUCT)


def callbacks(
    written: Derivatives, program: Mapping[str, ca.SX], sign: float, solver: str
) -> tuple[ca.Function, ...]:
    """Return all functions that a solver calls, by CasADi's names and with its signatures.

    Parameters
    ----------
    written
        Derivatives that replace those by automatic differentiation.
    program
        ``x``, ``f``, to be minimised, and ``g``.
    sign
        f over the objective, 1 or −1.
    solver
        ``"ipopt"`` or ``"fatrop"``, which differ in what they take.
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
    gradient, hessian = {"grad_f_x": values[2]}, {"grad_gamma_x": steep}
    if solver == "fatrop":
        hessian["hess_gamma_x_x"] = own + (written.shift or 0.0) * ca.MX.eye(x.numel())
    else:
        gradient = {"f": values[0], **gradient}
        hessian = {"triu_hess_gamma_x_x": ca.triu(own)}
    both = {"f": values[0], "g": values[1], "grad_gamma_x": steep, "grad_gamma_p": none}
    given = {"x": point, "p": none, "lam_f": sigma, "lam_g": multipliers}

    def function(name: str, inputs: Sequence[str], results: Mapping[str, ca.MX]) -> ca.Function:
        entries = [given[one] for one in inputs]
        return ca.Function(name, entries, list(results.values()), inputs, list(results))

    return (
        ca.Function("nlp", [x, p], [f, g], at, ["f", "g"]),
        ca.Function("nlp_f", [x, p], [f], at, ["f"]),
        ca.Function("nlp_g", [x, p], [g], at, ["g"]),
        function("nlp_grad", full, both),
        function("nlp_grad_f", at, gradient),
        function("nlp_jac_g", at, {"g": values[1], "jac_g_x": jacobian(point)}),
        function("nlp_hess_l", full, hessian),
    )


def shared_library(code: bytes, flags: Sequence[str] = STRAIGHT) -> Path | None:
    """Return the library made of C code; None, with a warning, if there cannot be one."""
    chosen = os.environ.get("CC")
    candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
    compiler = next((one for one in candidates if one and shutil.which(one[0])), None)
    why = "there is no C compiler; set CC to one"
    if compiler is not None:
        try:
            return _compile(code, [*compiler, *flags])
        except subprocess.CalledProcessError as reason:
            why = f"the C compiler failed with status {reason.returncode}"
        except OSError as reason:
            why = (reason.strerror or str(reason)).lower()
    warnings.warn(f"Not compiled: {why}.", RuntimeWarning, stacklevel=3)
    return None


def _compile(code: bytes, command: Sequence[str]) -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    # The folder is the user's own, and may be emptied at any time.
    folder = (Path(base) if base else Path.home() / ".cache") / "lockedjoint"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    library = folder / f"{hashlib.sha256(key).hexdigest()[:32]}.so"
    if library.exists():
        return library
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        source, built = Path(scratch, "callbacks.c"), Path(scratch, "callbacks.so")
        source.write_bytes(code)
        build = [*command, "-o", str(built), str(source), "-lm"]
        # In a session of its own: a Ctrl-C is for us, and not a failure of the compiler.
        subprocess.run(build, check=True, capture_output=True, start_new_session=True)
        built.replace(library)  # at once: no process ever finds a part of it
    return library
