"""The floor: both statements written out in C, without any library.

The residual by Levenberg–Marquardt. Max-min from there by an interior point method on the
reduced statement; where eq. (6) is attained already, the first stage is the answer.
"""

import ctypes
from functools import partial
from pathlib import Path

import numpy as np

from formulations import max_min, residual
from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from nlp.compiled import shared_library
from results.benchmark.measurement import NotRunError, Peer, Run

# -ffast-math without its flag that rounds subnormal numbers to 0 in the whole process.
_FLAGS = (
    *("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fassociative-math"),
    *("-fno-signed-zeros", "-ffinite-math-only", "-fPIC", "-shared"),
)
_MOST, _GRADIENT = 2000, 1e-7


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


def _prepare(arm: Arm, name: str, *settings: float) -> Run:
    solve = getattr(_functions(), name)

    def one(start: FloatArray) -> FloatArray:
        out = np.empty(arm.shape)
        solve(arm.shape[1], *settings, start.copy(), out)
        return out

    return one


def _residual(arm: Arm, exact: bool) -> Run:
    return _prepare(arm, "levenberg_marquardt", exact, _MOST, _GRADIENT)


PEERS = (
    *(
        Peer(
            f"floor: hand-written C, Levenberg–Marquardt, {name}",
            residual.NAME,
            partial(_residual, exact=exact),
            f"-O3, gradient below {_GRADIENT:g}",
        )
        for name, exact in (("exact Hessian", True), ("Gauss–Newton", False))
    ),
    Peer(
        "floor: hand-written C, reduced statement",
        max_min.NAME,
        lambda arm: _prepare(arm, "max_min", _MOST),
        "-O3, Gauss–Newton, then an interior point method",
    ),
)
