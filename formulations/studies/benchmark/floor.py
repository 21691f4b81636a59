"""The floor: Levenberg–Marquardt for the residual written out in C, without any library."""

import ctypes
from functools import partial
from importlib import resources

import numpy as np

from formulations import residual
from formulations.joints.arm import Arm
from formulations.studies.benchmark.measurement import NotRunError, Peer, Run, each
from nlp.arrays import FloatArray
from nlp.compiled import shared_library

# -ffast-math without its flag that rounds subnormal numbers to 0 in the whole process.
_FLAGS = (
    *("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fassociative-math"),
    *("-fno-signed-zeros", "-ffinite-math-only", "-fPIC", "-shared"),
)
_MOST, _GRADIENT = 2000, 1e-7


def _prepare(arm: Arm, batch: int, exact: bool) -> Run:  # noqa: ARG001
    code = resources.files("formulations.studies.benchmark").joinpath("floor.c").read_bytes()
    library = shared_library(code, _FLAGS)
    if library is None:
        raise NotRunError("no C compiler")
    solve = ctypes.CDLL(str(library)).levenberg_marquardt
    vector = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    solve.argtypes = [ctypes.c_int] * 3 + [ctypes.c_double, vector, vector]

    def one(start: FloatArray) -> FloatArray:
        out = np.empty(arm.shape)
        solve(arm.shape[1], exact, _MOST, _GRADIENT, start.copy(), out)
        return out

    return each(one, arm.shape)


PEERS = tuple(
    Peer(
        f"floor: hand-written C, Levenberg–Marquardt, {name}",
        residual.NAME,
        partial(_prepare, exact=exact),
        f"-O3, gradient below {_GRADIENT:g}",
    )
    for name, exact in (("exact Hessian", True), ("Gauss–Newton", False))
)
