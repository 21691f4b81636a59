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

import casadi as ca
import numpy as np

from formulations import max_min, residual
from formulations.joints.arm import Arm
from nlp.errors import InputError
from nlp.options import OptionValue
from nlp.problem import Constraint, Problem

NAME = "trade-off"
OPTIONS: Mapping[str, OptionValue] = max_min.OPTIONS


def build(arm: Arm, defect: float) -> Problem:
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
    if not 0 < defect < np.inf:
        raise InputError("isotropy defect", defect, "a finite number above 0")
    problem = max_min.build(arm, encoding="shared-factor")
    stated = residual.build(arm)  # of ½‖JJᵀ − (T/m)I‖_F², in the arm's variables
    own = problem.variables[: arm.size]
    deviation = ca.substitute(stated.objective, stated.variables, own)
    # Divided by ε, so that the solver's tolerance is relative.
    limit = Constraint("isotropy defect", deviation / defect, -np.inf, 1.0)
    return replace(problem, name=NAME, constraints=(*problem.constraints, limit))
