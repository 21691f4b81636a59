"""A problem's functions and derivatives compiled to machine code, once for all runs.

CasADi writes them as C; the system's compiler makes a library of that, which is kept in a cache
under a name made from the C code, the compiler's command and CasADi's version.
"""

import atexit
import hashlib
import os
import shlex
import shutil
import stat
import subprocess
import tempfile
import warnings
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import casadi as ca

#: The compiler's flags for straight-line code: higher levels take many times longer to compile
#: and make code that runs no faster.
STRAIGHT = ("-O1", "-fPIC", "-shared")
#: The compiler's flags for code with products of matrices, which are loops.
LOOPS = ("-O3", "-fPIC", "-shared")
# Number of hexadecimal digits of a hash that name a library.
_NAME_DIGITS = 32
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
    """Return the library of C code in the cache, which the command makes if it is not there."""
    base = os.environ.get("XDG_CACHE_HOME")
    # The folder is the user's own, and may be emptied at any time.
    folder = (Path(base) if base else Path.home() / ".cache") / "lockedjoint"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = folder.resolve()
    key = "\0".join([ca.CasadiMeta.version(), *command]).encode() + b"\0" + code
    name = f"{hashlib.sha256(key).hexdigest()[:_NAME_DIGITS]}.so"
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
        # The compiler has a session of its own: a Ctrl-C is for us, and not a failure of it.
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
        # Nobody replaces what is another's in a sticky folder, such as /tmp.
        shared = about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if shared and (place == path or not about.st_mode & stat.S_ISVTX):
            return f"other users can write to {place}"
    return ""


def _note(sentence: str) -> None:
    """Warn of something about the cache, at the line that asked for a solver."""
    warnings.warn(f"Compiled code: {sentence}.", RuntimeWarning, stacklevel=5)


@cache
def _private_folder() -> Path:
    """Return a folder that nobody else can write to, until this process ends."""
    folder = tempfile.mkdtemp(prefix="lockedjoint-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).resolve()
