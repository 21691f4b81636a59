"""SciPy's SLSQP on max-min as one would state it for SLSQP.

::

    maximise   t                     over the angles and t
    subject to λ_k(JJᵀ − j_f j_fᵀ) ≥ t      for every joint f and k = 1 … 6

All eigenvalues, not only the smallest, so that SLSQP sees which come next. Their derivatives
come from the eigenvectors; they jump where eigenvalues meet, and at the best Jacobians some do.
"""

from __future__ import annotations

import numpy as np

from formulations import max_min
from formulations.joints.arm import Arm
from formulations.studies.benchmark import unit_revolute as hand
from formulations.studies.benchmark.peer import Peer, Run, each
from nlp.arrays import FloatArray

_MOST, _TOLERANCE = 500, 1e-10


def _prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
    from scipy.optimize import minimize

    size = arm.size
    downwards = np.append(np.zeros(size), -1.0)

    def gaps(point: FloatArray) -> FloatArray:
        return np.asarray(hand.locked_eigenvalues(point[:-1])[0] - point[-1])

    def slopes(point: FloatArray) -> FloatArray:
        found = hand.locked_eigenvalues(point[:-1])[1]
        return np.asarray(np.column_stack([found, -np.ones(len(found))]))

    def one(start: FloatArray) -> FloatArray:
        level = hand.locked_eigenvalues(start)[0].min()
        found = minimize(
            lambda point: -point[-1],
            np.append(start, level),
            jac=lambda _: downwards,
            constraints={"type": "ineq", "fun": gaps, "jac": slopes},
            method="SLSQP",
            options={"ftol": _TOLERANCE, "maxiter": _MOST},
        )
        return hand.jacobian(found.x[:-1])

    return each(one, arm.shape)


PEERS = (
    Peer(
        "scipy SLSQP, eigenvalues as constraints",
        max_min.NAME,
        _prepare,
        f"analytic derivatives, ftol {_TOLERANCE:g}, at most {_MOST} steps",
    ),
)
