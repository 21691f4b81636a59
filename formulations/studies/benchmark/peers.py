"""All peers, this library first; a new one is one file and one line here."""

from collections.abc import Sequence

from formulations import max_min, residual
from formulations.joints.arm import Arm
from formulations.solving.setup import solver_options
from formulations.studies.benchmark import floor, jax_residual, pymanopt_residual, scipy_peers
from formulations.studies.benchmark.measurement import Peer, Run, each
from nlp.arrays import FloatArray
from nlp.solver import Solver


def residual_peer(name: str, solver: str, compiled: bool = False) -> Peer:
    """Return residual minimisation by one of this library's solvers."""

    def prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
        options = solver_options(residual.NAME, solver, {})
        built = Solver(residual.build(arm), options, solver, compiled)
        return each(lambda start: built.solve(start).outputs["jacobian"], arm.shape)

    return Peer(name, residual.NAME, prepare, "exact Hessian, default tolerances")


def max_min_peer(
    name: str, encoding: str = "shared-factor", compiled: bool = False, first: str = ""
) -> Peer:
    """Return max-min by this library; from residual minima if the solver `first` is named."""

    def prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
        problem = max_min.build(arm, encoding=encoding)
        built = Solver(problem, max_min.OPTIONS, compiled=compiled)
        if not first:
            return each(lambda start: built.solve(start).outputs["jacobian"], arm.shape)
        options = solver_options(residual.NAME, first, {})
        before = Solver(residual.build(arm), options, first, compiled)

        def one(start: FloatArray) -> FloatArray:
            return built.solve(before.solve(start).variables).outputs["jacobian"]

        return each(one, arm.shape)

    return Peer(name, max_min.NAME, prepare, f"encoding {encoding}")


PEERS: Sequence[Peer] = (
    residual_peer("lockedjoint, Ipopt (default)", "ipopt"),
    residual_peer("lockedjoint, Ipopt, compiled", "ipopt", compiled=True),
    residual_peer("lockedjoint, Fatrop", "fatrop"),
    residual_peer("lockedjoint, Fatrop, compiled (fast path)", "fatrop", compiled=True),
    max_min_peer("lockedjoint, shared factor (default)"),
    max_min_peer("lockedjoint, shared factor, compiled", compiled=True),
    max_min_peer("lockedjoint, from residual minima by Ipopt", first="ipopt"),
    max_min_peer(
        "lockedjoint, from residual minima by Fatrop, all compiled",
        first="fatrop",
        compiled=True,
    ),
    max_min_peer("classical: one free factor per failure", "factor-per-deletion"),
    max_min_peer("one positive factor per failure", "positive-factor-per-deletion"),
    *floor.PEERS,
    *scipy_peers.RESIDUAL,
    *jax_residual.PEERS,
    *pymanopt_residual.PEERS,
    *scipy_peers.MAX_MIN,
)
