"""First statement: residual minimisation (Section 4, eqs. 23–43).

::

    minimise  ½ ‖JJᵀ − (T/m) I‖_F²      over the joints' parameters,     T = ‖J‖_F²
    subject to the joints' own bounds

The squares of the m(m + 1)/2 isotropy equations, those of the diagonal counted half: so
weighted, the sum is the same in every frame. The paper's fᵀf counts all alike; its value
depends on the frame, and its minimum over frames is the sum above. Both have the same
minima, and the invariant one needs fewer iterations.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import casadi as ca

from formulations import measures
from formulations.arm import Arm
from formulations.isotropy_residuals import residuals
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.ipopt_options import OptionValue
from nlp.problem import Problem, Sense

NAME = "residual"
SENSE: Sense = "minimise"
OPTIONS: Mapping[str, OptionValue] = MappingProxyType({})
DIAGONAL_WEIGHTS: Mapping[str, float] = MappingProxyType({"invariant": 0.5, "paper": 1.0})


def build(arm: Arm, weighting: str = "invariant") -> Problem:
    """State the problem for an arm.

    Parameters
    ----------
    arm
        The joints.
    weighting
        ``"invariant"`` or ``"paper"``, see above.

    Raises
    ------
    InputError
        If the weighting is neither.
    """
    if weighting not in DIAGONAL_WEIGHTS:
        raise InputError("weighting", weighting, "one of " + ", ".join(DIAGONAL_WEIGHTS))
    variables = arm.symbols()
    rows = residuals(arm, variables)
    m, _ = arm.shape
    diagonal = DIAGONAL_WEIGHTS[weighting] * ca.sumsqr(rows[:m])
    return Problem(
        name=NAME,
        variables=variables,
        objective=diagonal + ca.sumsqr(rows[m:]),
        sense=SENSE,
        constraints=arm.constraints(variables),
        outputs={"jacobian": arm.matrix(variables)},
    )


def merit(jacobian: FloatArray, locked: int = 1) -> float:  # noqa: ARG001
    """What the statement minimises, from J alone."""
    return measures.isotropy_defect(jacobian)
