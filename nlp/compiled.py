"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept under a
name made from the C code, the compiler's command and CasADi's version. Any process that needs
the same functions again uses it.
"""

import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

# Straight-line code: higher levels take many times longer to compile and run no faster.
_FLAGS = ("-O1", "-fPIC", "-shared")


def compiled_callbacks(solver: ca.Function) -> Path | None:
    """Return the library with a solver's callbacks, made if it is not in the cache.

    Parameters
    ----------
    solver
        From ``casadi.nlpsol``; build it again with the library in place of the expressions.

    Returns
    -------
    Path or None
        None, with a warning, if there is no working C compiler or nowhere to keep it.
    """
    generator = ca.CodeGenerator("callbacks")
    generator.add(solver.oracle())
    for name in solver.get_function():
        generator.add(solver.get_function(name))
    return shared_library(str(generator.dump()).encode())


def shared_library(code: bytes, flags: Sequence[str] = _FLAGS) -> Path | None:
    """Return the library made of C code; None, with a warning, if there cannot be one."""
    compiler, why = _compiler(), "there is no C compiler; set CC to one"
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
    # The folder may be emptied at any time.
    folder = (Path(base) if base else Path.home() / ".cache") / "lockedjoint"
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    library = folder / f"{hashlib.sha256(key).hexdigest()[:32]}.so"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        if not library.exists():
            source, built = Path(scratch, "callbacks.c"), Path(scratch, "callbacks.so")
            source.write_bytes(code)
            build = [*command, "-o", str(built), str(source), "-lm"]
            subprocess.run(build, check=True, capture_output=True)
            built.replace(library)  # whole or not at all, also for a process that looks now
    return library


def _compiler() -> list[str] | None:
    chosen = os.environ.get("CC")
    candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
    return next((one for one in candidates if one and shutil.which(one[0])), None)
