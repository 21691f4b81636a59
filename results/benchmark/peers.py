"""All peers as a table, this library first; a new one is a function and a line here."""

from collections.abc import Callable, Sequence
from functools import partial

from formulations import max_min, residual
from formulations.joints.arm import Arm
from formulations.registry import Formulation
from nlp.solver import Solver
from results.benchmark import floor
from results.benchmark import other_libraries as others
from results.benchmark.measurement import Peer, Solve

DEFAULT = "lockedjoint, Ipopt (default)"
FAST = "lockedjoint, Fatrop, compiled (fast path)"
CLASSICAL = "classical: one free factor per failure"
# Most steps of the hand-written C, and the gradient at which it ends.
_STEPS, _GRADIENT = 2000, 1e-7


def own(
    formulation: Formulation, solver: str = "ipopt", compiled: bool = False, **stated: object
) -> Callable[[Arm], Solve]:
    """Return what prepares a formulation of this library for one of its solvers."""

    def prepare(arm: Arm) -> Solve:
        built = Solver(formulation.build(arm, **stated), name=solver, compiled=compiled)
        return lambda start: built.solve(start).outputs["jacobian"]

    return prepare


def _max_min(
    name: str, encoding: str = "two-stage", solver: str = "ipopt", compiled: bool = False
) -> Peer:
    prepare = own(max_min, solver, compiled, encoding=encoding)
    return Peer(name, "max-min", prepare, f"encoding {encoding}")


def _floor(name: str, exact: bool) -> Peer:
    function = "levenberg_marquardt", exact, _STEPS, _GRADIENT
    return Peer(
        f"floor: hand-written C, Levenberg–Marquardt, {name}",
        "residual",
        lambda arm: floor.prepare(arm, *function),
        f"-O3, gradient below {_GRADIENT:g}",
    )


def _least_squares(method: str) -> Peer:
    prepare = partial(others.least_squares_residual, method=method)
    words = "analytic Jacobian, default tolerances"
    return Peer(f"scipy least_squares {method}", "residual", prepare, words)


_EXACT = "exact Hessian, default tolerances"
_CHOSEN = "exact Hessian at 7R, Gauss–Newton above, default tolerances"
_FTOL = f"ftol {others.TOLERANCE:g}"
_JAX = f"float64, at most {others.JAX_STEPS} steps, gradient below {others.JAX_GRADIENT:g}"

PEERS: Sequence[Peer] = (
    Peer(DEFAULT, "residual", own(residual), _CHOSEN),
    Peer(
        "lockedjoint, Ipopt, exact Hessian", "residual", own(residual, hessian="exact"), _EXACT
    ),
    Peer(FAST, "residual", own(residual, "fatrop", True), _CHOSEN),
    Peer(
        "lockedjoint, Fatrop, compiled, exact Hessian",
        "residual",
        own(residual, "fatrop", True, hessian="exact"),
        _EXACT,
    ),
    _floor("exact Hessian", True),
    _floor("Gauss–Newton", False),
    _least_squares("trf"),
    _least_squares("lm"),
    Peer("scipy SLSQP", "residual", others.slsqp_residual, f"analytic gradient, {_FTOL}"),
    Peer(
        "JAX, batched Levenberg–Marquardt",
        "residual",
        partial(others.jax_residual, exact=False),
        _JAX,
        batched=True,
    ),
    Peer(
        "JAX, batched Newton, damped",
        "residual",
        partial(others.jax_residual, exact=True),
        _JAX,
        batched=True,
    ),
    Peer(
        "pymanopt, trust regions on SO(3)ⁿ",
        "residual",
        others.pymanopt_residual,
        "analytic gradient and Hessian, default tolerances",
    ),
    _max_min(DEFAULT),
    _max_min(FAST, solver="fatrop", compiled=True),
    _max_min("lockedjoint, Schur complement, one stage", "schur-complement"),
    _max_min("lockedjoint, shared factor", "shared-factor"),
    _max_min(CLASSICAL, "factor-per-deletion"),
    _max_min("one positive factor per failure", "positive-factor-per-deletion"),
    Peer(
        "floor: hand-written C, reduced statement",
        "max-min",
        lambda arm: floor.prepare(arm, "max_min", _STEPS),
        "-O3, Gauss–Newton, then an interior point method",
    ),
    Peer(
        "scipy SLSQP, eigenvalues as constraints",
        "max-min",
        others.slsqp_max_min,
        f"analytic derivatives, {_FTOL}, at most {others.MOST} steps",
    ),
    Peer(
        "Schatten smoothing, scipy L-BFGS",
        "max-min",
        others.schatten_max_min,
        f"p from {others.POWERS[0]:g} to {others.POWERS[-1]:g}",
    ),
)
