"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept under a
name made from the C code, the compiler's command and CasADi's version. Any process that needs
the same functions again uses it.
"""

from __future__ import annotations

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


def cache_folder() -> Path:
    """Return the folder of the compiled libraries; it may be emptied at any time."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "lockedjoint"


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
    return shared_library(_c_code(solver))


def shared_library(code: bytes, flags: Sequence[str] = _FLAGS) -> Path | None:
    """Return the library made of C code; None, with a warning, if there cannot be one."""
    compiler = _compiler()
    if compiler is None:
        _warn("there is no C compiler; set CC to one")
        return None
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            return _compile(code, [*compiler, *flags], folder, Path(scratch))
    except subprocess.CalledProcessError as reason:
        _warn(f"the C compiler failed with status {reason.returncode}")
    except OSError as reason:
        _warn((reason.strerror or str(reason)).lower())
    return None


def _compile(code: bytes, command: Sequence[str], folder: Path, scratch: Path) -> Path:
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    library = folder / f"{hashlib.sha256(key).hexdigest()[:32]}.so"
    if not library.exists():
        source, built = scratch / "callbacks.c", scratch / "callbacks.so"
        source.write_bytes(code)
        build = [*command, "-o", str(built), str(source), "-lm"]
        subprocess.run(build, check=True, capture_output=True)
        built.replace(library)  # whole or not at all, also for a process that looks meanwhile
    return library


def _c_code(solver: ca.Function) -> bytes:
    generator = ca.CodeGenerator("callbacks")
    generator.add(solver.oracle())
    for name in solver.get_function():
        generator.add(solver.get_function(name))
    return str(generator.dump()).encode()


def _compiler() -> list[str] | None:
    chosen = os.environ.get("CC")
    candidates = [shlex.split(chosen)] if chosen else [["cc"], ["gcc"], ["clang"]]
    return next((one for one in candidates if one and shutil.which(one[0])), None)


def _warn(reason: str) -> None:
    warnings.warn(f"Not compiled: {reason}.", RuntimeWarning, stacklevel=4)
