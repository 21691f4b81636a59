"""All peers, this library first; a new one is one file and one line here."""

from collections.abc import Callable, Sequence

from formulations import max_min, residual
from formulations.formulation import Formulation
from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from nlp.solver import Solver
from results.benchmark import floor, jax_residual, pymanopt_residual, scipy_peers
from results.benchmark.measurement import Peer

DEFAULT = "lockedjoint, Ipopt (default)"
FAST = "lockedjoint, Fatrop, compiled (fast path)"
CLASSICAL = "classical: one free factor per failure"


def own(
    name: str,
    formulation: Formulation,
    settings: str,
    solver: str = "ipopt",
    compiled: bool = False,
    **stated: object,
) -> Peer:
    """Return a formulation of this library by one of its solvers."""

    def prepare(arm: Arm) -> Callable[[FloatArray], FloatArray]:
        built = Solver(formulation.build(arm, **stated), name=solver, compiled=compiled)
        return lambda start: built.solve(start).outputs["jacobian"]

    return Peer(name, formulation.NAME, prepare, settings)


def _residual(name: str, solver: str, compiled: bool = False, exact: bool = False) -> Peer:
    which = "exact Hessian" if exact else "exact Hessian at 7R, Gauss–Newton above"
    hessian = "exact" if exact else None
    words = f"{which}, default tolerances"
    return own(name, residual, words, solver, compiled, hessian=hessian)


def _max_min(
    name: str, encoding: str = "two-stage", solver: str = "ipopt", compiled: bool = False
) -> Peer:
    return own(name, max_min, f"encoding {encoding}", solver, compiled, encoding=encoding)


PEERS: Sequence[Peer] = (
    _residual(DEFAULT, "ipopt"),
    _residual("lockedjoint, Ipopt, exact Hessian", "ipopt", exact=True),
    _residual(FAST, "fatrop", compiled=True),
    _residual("lockedjoint, Fatrop, compiled, exact Hessian", "fatrop", True, True),
    _max_min(DEFAULT),
    _max_min(FAST, solver="fatrop", compiled=True),
    _max_min("lockedjoint, Schur complement, one stage", "schur-complement"),
    _max_min("lockedjoint, shared factor", "shared-factor"),
    _max_min(CLASSICAL, "factor-per-deletion"),
    _max_min("one positive factor per failure", "positive-factor-per-deletion"),
    *floor.PEERS,
    *scipy_peers.RESIDUAL,
    *jax_residual.PEERS,
    *pymanopt_residual.PEERS,
    *scipy_peers.MAX_MIN,
)
