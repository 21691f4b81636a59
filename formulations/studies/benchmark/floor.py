"""The floor: Levenberg–Marquardt for the residual written out in C, no library at all."""

from __future__ import annotations

import ctypes
from functools import partial
from importlib import resources

import numpy as np

from formulations import residual
from formulations.joints.arm import Arm
from formulations.studies.benchmark.peer import NotRunError, Peer, Run, each
from nlp.arrays import FloatArray
from nlp.compiled import shared_library

# All of -ffast-math but what would round subnormal numbers to 0 in the whole process.
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
    call = ctypes.CDLL(str(library)).levenberg_marquardt
    pointer = ctypes.POINTER(ctypes.c_double)
    call.argtypes = [ctypes.c_int] * 3 + [ctypes.c_double, pointer, pointer]
    m, n = arm.shape

    def one(start: FloatArray) -> FloatArray:
        x, out = start.copy(), np.empty((m, n))
        call(n, exact, _MOST, _GRADIENT, x.ctypes.data_as(pointer), out.ctypes.data_as(pointer))
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
