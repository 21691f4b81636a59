"""All peers as a table, this library first; a new one is a function and a line here."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations import max_min, residual
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.registry import Formulation
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.compiled import shared_library
from lockedjoint.nlp.solver import Solver
from results.benchmark import other_libraries as others
from results.benchmark.other_libraries import NotRunError, Solve

DEFAULT = "lockedjoint, Ipopt (default)"
FAST = "lockedjoint, Fatrop, compiled (fast path)"
CLASSICAL = "classical: one free factor per failure"
_COMPILED = "lockedjoint, Fatrop, compiled"
_FLOOR = "floor: hand-written C, Levenberg–Marquardt"
# Most steps of the hand-written C, and the gradient at which it ends.
_ENDS = 2000, 1e-7
# -ffast-math without its flag that rounds subnormal numbers to 0 in the whole process.
_FLAGS = (
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fassociative-math",
    "-fno-signed-zeros",
    "-ffinite-math-only",
    "-fPIC",
    "-shared",
)


@dataclass(frozen=True)
class Peer:
    """A way to solve one statement, ``residual`` or ``max-min``, on unit revolute joints.

    Attributes
    ----------
    prepare
        Sets up for an arm and returns what solves one start, shape (size of the arm,), for
        the Jacobian; its time is reported separately. Raises NotRunError, or ImportError
        where a package is missing.
    settings
        How it is set up, in words.
    batched
        Whether it is prepared for an arm and a number of starts, and then solves batches of
        that size only.
    """

    name: str
    formulation: str
    prepare: Callable[..., Solve]
    settings: str = ""
    batched: bool = False


def own(
    formulation: Formulation, solver: str = "ipopt", **stated: object
) -> Callable[[Arm], Solve]:
    """Return what prepares a formulation of this library for one of its solvers."""

    def prepare(arm: Arm) -> Solve:
        built = Solver(formulation.build(arm, **stated), name=solver)
        return lambda start: built.solve(start).outputs["jacobian"]

    return prepare


def floor(function: str, *settings: float) -> Callable[[Arm], Solve]:
    """Return what prepares a function of ``floor.c``, with these settings.

    Both statements written out, without any library: the residual by Levenberg–Marquardt;
    max-min from there by an interior point method on the reduced statement. Where eq. (6) is
    attained already, the first stage is the answer.
    """

    def prepare(arm: Arm) -> Solve:
        path = shared_library(Path(__file__).with_name("floor.c").read_bytes(), _FLAGS)
        if path is None:
            raise NotRunError("no C compiler")
        compiled = getattr(ctypes.CDLL(str(path)), function)
        vector = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
        real, integer = ctypes.c_double, ctypes.c_int
        kinds = [real if isinstance(value, float) else integer for value in settings]
        compiled.argtypes = [integer, *kinds, vector, vector]

        def solve(start: FloatArray) -> FloatArray:
            out = np.empty(arm.shape)
            compiled(arm.shape[1], *settings, start.copy(), out)
            return out

        return solve

    return prepare


def _residual(name: str, settings: str, prepare: Callable[..., Solve]) -> Peer:
    return Peer(name, "residual", prepare, settings, batched=name.startswith("JAX"))


def _max_min(name: str, encoding: str = "two-stage", *solver: Any) -> Peer:
    prepare = own(max_min, *solver, encoding=encoding)
    return Peer(name, "max-min", prepare, f"encoding {encoding}")


_EXACT = "exact Hessian, default tolerances"
_CHOSEN = "exact Hessian at 7R, Gauss–Newton above, default tolerances"
_WRITTEN = f"-O3, gradient below {_ENDS[1]:g}"
_JAX = f"float64, at most {others.JAX_STEPS} steps, gradient below {others.JAX_GRADIENT:g}"

PEERS: Sequence[Peer] = (
    _residual(DEFAULT, _CHOSEN, own(residual)),
    _residual("lockedjoint, Ipopt, exact Hessian", _EXACT, own(residual, hessian="exact")),
    _residual(FAST, _CHOSEN, own(residual, "fatrop")),
    _residual(f"{_COMPILED}, exact Hessian", _EXACT, own(residual, "fatrop", hessian="exact")),
    _residual(f"{_FLOOR}, exact Hessian", _WRITTEN, floor("levenberg_marquardt", True, *_ENDS)),
    _residual(f"{_FLOOR}, Gauss–Newton", _WRITTEN, floor("levenberg_marquardt", False, *_ENDS)),
    _residual(
        "scipy least_squares trf",
        "analytic Jacobian, default tolerances",
        others.least_squares_residual,
    ),
    _residual("JAX, batched Levenberg–Marquardt", _JAX, others.jax_residual),
    _residual(
        "pymanopt, trust regions on SO(3)ⁿ",
        "analytic gradient and Hessian, default tolerances",
        others.pymanopt_residual,
    ),
    _max_min(DEFAULT),
    _max_min(FAST, "two-stage", "fatrop"),
    _max_min("lockedjoint, Schur complement, one stage", "schur-complement"),
    _max_min("lockedjoint, shared factor", "shared-factor"),
    _max_min(CLASSICAL, "factor-per-deletion"),
    _max_min("one positive factor per failure", "positive-factor-per-deletion"),
    Peer(
        "floor: hand-written C, reduced statement",
        "max-min",
        floor("max_min", _ENDS[0]),
        "-O3, Gauss–Newton, then an interior point method",
    ),
    *(
        Peer(
            f"scipy SLSQP, {which} eigenvalues as constraints",
            "max-min",
            partial(others.slsqp_max_min, most=most),
            f"analytic derivatives, ftol {others.TOLERANCE:g}, at most {others.MOST} steps",
        )
        for which, most in (("all", 6), ("smallest", 1))
    ),
)
