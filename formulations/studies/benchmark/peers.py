"""All peers, this library first; a new one is one file and one line here."""

from collections.abc import Sequence

from formulations import max_min, residual
from formulations.joints.arm import Arm
from formulations.studies.benchmark import floor, jax_residual, pymanopt_residual, scipy_peers
from formulations.studies.benchmark.measurement import Peer, Run, each
from nlp.solver import Solver


def residual_peer(
    name: str, solver: str, compiled: bool = False, hessian: str | None = None
) -> Peer:
    """Return residual minimisation by one of this library's solvers."""

    def prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
        problem = residual.build(arm, hessian=hessian)
        built = Solver(problem, name=solver, compiled=compiled)
        return each(lambda start: built.solve(start).outputs["jacobian"], arm.shape)

    which = f"{hessian} Hessian" if hessian else "exact Hessian at 7R, Gauss–Newton above"
    return Peer(name, residual.NAME, prepare, f"{which}, default tolerances")


def max_min_peer(
    name: str, encoding: str = "two-stage", solver: str = "ipopt", compiled: bool = False
) -> Peer:
    """Return max-min by this library."""

    def prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
        problem = max_min.build(arm, encoding=encoding)
        built = Solver(problem, name=solver, compiled=compiled)
        return each(lambda start: built.solve(start).outputs["jacobian"], arm.shape)

    return Peer(name, max_min.NAME, prepare, f"encoding {encoding}")


DEFAULT = "lockedjoint, Ipopt (default)"
FAST = "lockedjoint, Fatrop, compiled (fast path)"
CLASSICAL = "classical: one free factor per failure"
PEERS: Sequence[Peer] = (
    residual_peer(DEFAULT, "ipopt"),
    residual_peer("lockedjoint, Ipopt, exact Hessian", "ipopt", hessian="exact"),
    residual_peer(FAST, "fatrop", compiled=True),
    residual_peer("lockedjoint, Fatrop, compiled, exact Hessian", "fatrop", True, "exact"),
    max_min_peer(DEFAULT),
    max_min_peer(FAST, solver="fatrop", compiled=True),
    max_min_peer("lockedjoint, Schur complement, one stage", "schur-complement"),
    max_min_peer("lockedjoint, shared factor", "shared-factor"),
    max_min_peer(CLASSICAL, "factor-per-deletion"),
    max_min_peer("one positive factor per failure", "positive-factor-per-deletion"),
    *floor.PEERS,
    *scipy_peers.RESIDUAL,
    *jax_residual.PEERS,
    *pymanopt_residual.PEERS,
    *scipy_peers.MAX_MIN,
)
