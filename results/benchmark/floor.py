"""The floor: both statements written out in C, without any library.

The residual by Levenberg–Marquardt. Max-min from there by an interior point method on the
reduced statement; where eq. (6) is attained already, the first stage is the answer.
"""

import ctypes
from pathlib import Path

import numpy as np

from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from nlp.compiled import shared_library
from results.benchmark.measurement import NotRunError, Solve

# -ffast-math without its flag that rounds subnormal numbers to 0 in the whole process.
_FLAGS = (
    *("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fassociative-math"),
    *("-fno-signed-zeros", "-ffinite-math-only", "-fPIC", "-shared"),
)


def _functions() -> ctypes.CDLL:
    path = shared_library(Path(__file__).with_suffix(".c").read_bytes(), _FLAGS)
    if path is None:
        raise NotRunError("no C compiler")
    library = ctypes.CDLL(str(path))
    vector = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    real, integer = ctypes.c_double, ctypes.c_int
    library.levenberg_marquardt.argtypes = [integer, integer, integer, real, vector, vector]
    library.max_min.argtypes = [integer, integer, vector, vector]
    return library


def prepare(arm: Arm, function: str, *settings: float) -> Solve:
    """Return what solves a start by a function of ``floor.c`` with these settings."""
    compiled = getattr(_functions(), function)

    def solve(start: FloatArray) -> FloatArray:
        out = np.empty(arm.shape)
        compiled(arm.shape[1], *settings, start.copy(), out)
        return out

    return solve
