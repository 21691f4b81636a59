"""All peers of the benchmark as a table: a new one is a function and a line in `PEERS`.

A peer is a way to solve one of two statements for n unit revolute joints, whose Jacobian J,
shape (6, n), has columns (v_i; w_i) of unit vectors v_i and w_i at right angles:

- ``residual``: J as near to isotropy, JJᵀ = n/3 · I, as can be;
- ``max-min``: the worst case, the least singular value of J after the worst joint has locked,
  as large as can be.

A start is a vector of three angles in radians for each joint, shape (3n,), dtype float64; what
a peer answers is J. ``benchmark.py`` prepares peers, gives all the same starts and takes times.
"""

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

#: Names of peers that other files look up.
DEFAULT = "lockedjoint, Ipopt (default)"
FAST = "lockedjoint, Fatrop, compiled (fast path)"
CLASSICAL = "classical: one free factor per failure"
# Beginnings of names that several peers share.
_COMPILED = "lockedjoint, Fatrop, compiled"
_FLOOR = "floor: hand-written C, Levenberg–Marquardt"
# Most steps of a function of the hand-written C, for each start. With fewer of them
# slow starts end before they are at an optimum; with more only these take longer.
_FLOOR_STEPS = 2000
# Largest component of the gradient at which Levenberg–Marquardt ends. If it is smaller,
# answers have more digits, and starts take more steps.
_FLOOR_GRADIENT = 1e-7
# The flags of the C compiler are those of -ffast-math without the one that rounds
# subnormal numbers to 0 in the whole process.
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
    name, settings
        What the tables call it, and how it is set up, in words.
    formulation
        The statement, ``residual`` or ``max-min``.
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
    """Return what prepares a function of ``floor.c``, with the numbers it asks for first.

    They are passed in the order given, a float as a double and others as an int; what they mean
    is said in ``floor.c``.

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


def _floor_residual(*, exact: bool) -> Callable[[Arm], Solve]:
    """Return what prepares Levenberg–Marquardt, with the exact Hessian or Gauss–Newton's."""
    return floor("levenberg_marquardt", exact, _FLOOR_STEPS, _FLOOR_GRADIENT)


def _residual(name: str, settings: str, prepare: Callable[..., Solve]) -> Peer:
    """Return a peer for the residual; those in JAX solve a batch of starts at once."""
    return Peer(name, "residual", prepare, settings, batched=name.startswith("JAX"))


def _max_min(name: str, encoding: str = "two-stage", *solver: Any) -> Peer:
    """Return this library as a peer for max-min: an encoding, and a solver if not Ipopt."""
    prepare = own(max_min, *solver, encoding=encoding)
    return Peer(name, "max-min", prepare, f"encoding {encoding}")


# Settings in words, as the tables of the benchmark show them.
_EXACT = "exact Hessian, default tolerances"
_CHOSEN = "exact Hessian at 7R, Gauss–Newton above, default tolerances"
_WRITTEN = f"-O3, gradient below {_FLOOR_GRADIENT:g}"
_JAX = f"float64, at most {others.JAX_STEPS} steps, gradient below {others.JAX_GRADIENT:g}"

PEERS: Sequence[Peer] = (
    _residual(DEFAULT, _CHOSEN, own(residual)),
    _residual("lockedjoint, Ipopt, exact Hessian", _EXACT, own(residual, hessian="exact")),
    _residual(FAST, _CHOSEN, own(residual, "fatrop")),
    _residual(f"{_COMPILED}, exact Hessian", _EXACT, own(residual, "fatrop", hessian="exact")),
    _residual(f"{_FLOOR}, exact Hessian", _WRITTEN, _floor_residual(exact=True)),
    _residual(f"{_FLOOR}, Gauss–Newton", _WRITTEN, _floor_residual(exact=False)),
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
        floor("max_min", _FLOOR_STEPS),
        "-O3, Gauss–Newton, then an interior point method",
    ),
    *(
        Peer(
            f"scipy SLSQP, {which} eigenvalues as constraints",
            "max-min",
            partial(others.slsqp_max_min, most=most),
            f"analytic derivatives, ftol {others.TOLERANCE:g}, at most {others.MOST} steps",
        )
        for which, most in (("all", 6), ("smallest", 1))  # eigenvalues of a 6 × 6 matrix
    ),
)
