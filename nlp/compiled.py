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
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

# Straight-line code: higher levels take many times longer to compile and run no faster.
STRAIGHT = ("-O1", "-fPIC", "-shared")
# Products of matrices are loops.
LOOPS = ("-O3", "-fPIC", "-shared")
# CasADi's product of dense matrices adds to one entry at a time. With its inner loops exchanged
# the compiler works on several entries at once; each sum keeps its order.
_ENTRIES = "for (j=0; j<nrow_x; ++j) {"
_TERMS = "for (k=0; k<ncol_x; ++k) {"
_DEEPER = "\n        "
_PRODUCT = (_ENTRIES + _DEEPER + _TERMS, _TERMS + _DEEPER + _ENTRIES)


def compiled_function(function: ca.Function) -> ca.Function | None:
    """Return a function as machine code; None, with a warning, without a compiler."""
    library = library_of([function], STRAIGHT)
    return None if library is None else ca.external(function.name(), str(library))


def library_of(
    functions: Sequence[ca.Function], flags: Sequence[str], entry: str = ""
) -> Path | None:
    """Return a library with these functions, and with an entry point in C.

    None, with a warning, if there cannot be one.
    """
    generator = ca.CodeGenerator("callbacks")
    for function in functions:
        generator.add(function)
    code = str(generator.dump()).replace(*_PRODUCT) + entry
    return shared_library(code.encode(), flags)


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
