"""Between the second statement and the third: the best worst case at a limited isotropy defect.

::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − j_f j_fᵀ) ≥ t      for every joint f
               ½ ‖JJᵀ − (T/m) I‖_F² ≤ ε,      T = ‖J‖_F²
               the joints' own bounds

That is `max_min` with one more constraint. A large ε gives max-min; ε → 0 gives the statement
`isotropy`, where isotropic Jacobians exist. At ε = 0 itself the constraint has no gradient:
ask `isotropy`.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import casadi as ca
import numpy as np

from formulations import max_min, measures, residual
from formulations.bounds.certified import Bound
from formulations.joints.joint import ColumnModel
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.problem import Constraint, Problem, Sense

NAME = "trade-off"
SENSE: Sense = "maximise"
SETTINGS: Mapping[str, object] = MappingProxyType({"defect": 1.0})
# By how much of the limit a defect may pass it.
_SLACK = 1e-6


def build(arm: ColumnModel, defect: float) -> Problem:
    """State the problem for an arm.

    Parameters
    ----------
    arm
        The joints.
    defect
        The largest isotropy defect ε allowed, above 0, in the units of J to the fourth.

    Raises
    ------
    InputError
        If the defect is not a finite number above 0, or the joints allow no max-min problem.
    """
    check(arm, defect)
    problem = max_min.build(arm, encoding="shared-factor")
    stated = residual.build(arm)  # of ½‖JJᵀ − (T/m)I‖_F², in the arm's variables
    own = problem.variables[: arm.size]
    deviation = ca.substitute(stated.objective, stated.variables, own)
    # Divided by ε, so that the solver's tolerance is relative.
    limit = Constraint("isotropy defect", deviation / defect, -np.inf, 1.0)
    return replace(problem, name=NAME, constraints=(*problem.constraints, limit))


def check(arm: ColumnModel, defect: float) -> Mapping[str, object]:  # noqa: ARG001
    """Return the settings; InputError if the defect is not a finite number above 0."""
    number = isinstance(defect, int | float) and not isinstance(defect, bool)
    if not number or not 0 < defect < np.inf:
        raise InputError("isotropy defect", defect, "a finite number above 0")
    return {"defect": float(defect)}


def score(jacobian: FloatArray, defect: float) -> float:
    """What the statement maximises, √t from J alone; −∞ if J's defect is above the limit."""
    if measures.isotropy_defect(jacobian) > defect * (1 + _SLACK):
        return -np.inf
    return measures.worst_case_sigma(jacobian)


def bound(arm: ColumnModel, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return the bound of max-min, which holds at every defect; see `Formulation`."""
    return max_min.bound(arm, locked, certified)
