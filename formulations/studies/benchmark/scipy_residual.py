"""SciPy on the residual: least squares (trf, lm) and SLSQP, with analytic derivatives."""

from __future__ import annotations

from formulations import residual
from formulations.joints.arm import Arm
from formulations.studies.benchmark import unit_revolute as hand
from formulations.studies.benchmark.peer import NotRunError, Peer, Run, each
from nlp.arrays import FloatArray


def _least_squares(method: str, arm: Arm) -> Run:
    from scipy.optimize import least_squares

    if method == "lm" and arm.size > 21:
        raise NotRunError("lm wants as many residuals as unknowns")

    def one(start: FloatArray) -> FloatArray:
        found = least_squares(hand.residuals, start, hand.derivatives, method=method)
        return hand.jacobian(found.x)

    return each(one, arm.shape)


def _slsqp(arm: Arm) -> Run:
    from scipy.optimize import minimize

    def both(angles: FloatArray) -> tuple[float, FloatArray]:
        rows = hand.residuals(angles)
        return float(rows @ rows), 2 * rows @ hand.derivatives(angles)

    def one(start: FloatArray) -> FloatArray:
        options = {"ftol": 1e-10, "maxiter": 1000}
        found = minimize(both, start, jac=True, method="SLSQP", options=options)
        return hand.jacobian(found.x)

    return each(one, arm.shape)


_EXACT = "analytic Jacobian, default tolerances"
PEERS = (
    Peer(
        "scipy least_squares trf", residual.NAME, lambda a, _: _least_squares("trf", a), _EXACT
    ),
    Peer("scipy least_squares lm", residual.NAME, lambda a, _: _least_squares("lm", a), _EXACT),
    Peer("scipy SLSQP", residual.NAME, lambda a, _: _slsqp(a), "analytic gradient, ftol 1e-10"),
)
