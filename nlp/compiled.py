"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept under a
name made from the C code, the compiler's command and CasADi's version, and from the library's
own content. Any process that needs the same functions again uses it, if it still has the
content that its name promises. A library is code that runs with the user's rights, so it is
kept only where nobody else can write.
"""

import hashlib
import os
import shlex
import shutil
import stat
import subprocess
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca

from nlp.errors import FileError
from nlp.files import write_bytes
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
    compiler, why = _compiler(), "there is no C compiler; set CC to one"
    if compiler is not None:
        try:
            return _compile(code, [*compiler, *flags])
        except subprocess.CalledProcessError as reason:
            why = f"the C compiler failed with status {reason.returncode}"
        except OSError as reason:
            why = (reason.strerror or str(reason)).lower()
        except FileError as reason:
            why = str(reason).rstrip(".")
    warnings.warn(f"Not compiled: {why}.", RuntimeWarning, stacklevel=3)
    return None


def _compile(code: bytes, command: Sequence[str]) -> Path:
    folder = _cache()
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    name = hashlib.sha256(key).hexdigest()[:32]
    for library in folder.glob(f"{name}-*.so"):
        if library.name == _library_name(name, library.read_bytes()):
            return library
        library.unlink(missing_ok=True)  # cut off or changed; loading it could end the process
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        source, built = Path(scratch, "callbacks.c"), Path(scratch, "callbacks.so")
        source.write_bytes(code)
        build = [*command, "-o", str(built), str(source), "-lm"]
        # In a session of its own: a Ctrl-C is for us, and not a failure of the compiler.
        subprocess.run(build, check=True, capture_output=True, start_new_session=True)
        content = built.read_bytes()
    library = folder / _library_name(name, content)
    write_bytes(library, content)
    return library


def _library_name(name: str, content: bytes) -> str:
    return f"{name}-{hashlib.sha256(content).hexdigest()[:32]}.so"


def _cache() -> Path:
    """Return the folder of the libraries; FileError if others could put theirs there."""
    base = os.environ.get("XDG_CACHE_HOME")
    # The folder may be emptied at any time.
    folder = (Path(base) if base else Path.home() / ".cache") / "lockedjoint"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = folder.resolve()
    if os.name == "posix":
        for place in (folder, *folder.parents):
            if _open_to_others(place, within=place != folder):
                allowed = f"a folder that nobody else can write to, which {place} is not"
                raise FileError("cache", str(folder), allowed)
    return folder


def _open_to_others(place: Path, within: bool) -> bool:
    """Return whether others can replace what is in a folder, or a folder within it."""
    known, user = place.stat(), os.geteuid()
    # Many systems give each user a group of their own, and make its folders writable to it.
    shared = stat.S_IWOTH | (0 if within and known.st_gid == os.getegid() else stat.S_IWGRP)
    sticky = within and known.st_mode & stat.S_ISVTX
    owners = (user, 0) if within else (user,)
    return known.st_uid not in owners or bool(known.st_mode & shared and not sticky)


def _compiler() -> list[str] | None:
    chosen = os.environ.get("CC")
    candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
    return next((one for one in candidates if one and shutil.which(one[0])), None)
