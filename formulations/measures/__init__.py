"""Failure tolerance of a Jacobian, from the matrix alone (Section 2, eqs. 3–11 and 15).

The independent judge of every solution: plain NumPy, no solver, no model of the joints.
Jacobians are arrays of shape (m, n) with n > m; joints are counted from 0.
"""

from lockedjoint.formulations.measures.jacobian import as_jacobian as as_jacobian
from lockedjoint.formulations.measures.jacobian import averaged_spectrum as averaged_spectrum
from lockedjoint.formulations.measures.jacobian import condition_number as condition_number
from lockedjoint.formulations.measures.jacobian import eigenvalue_bound as eigenvalue_bound
from lockedjoint.formulations.measures.jacobian import gap_percent as gap_percent
from lockedjoint.formulations.measures.jacobian import (
    is_optimally_failure_tolerant as is_optimally_failure_tolerant,
)
from lockedjoint.formulations.measures.jacobian import isotropy_defect as isotropy_defect
from lockedjoint.formulations.measures.jacobian import locked_sets as locked_sets
from lockedjoint.formulations.measures.jacobian import (
    locked_singular_values as locked_singular_values,
)
from lockedjoint.formulations.measures.jacobian import manipulability as manipulability
from lockedjoint.formulations.measures.jacobian import (
    null_space_contributions as null_space_contributions,
)
from lockedjoint.formulations.measures.jacobian import (
    range_contributions as range_contributions,
)
from lockedjoint.formulations.measures.jacobian import (
    reciprocal_conditions as reciprocal_conditions,
)
from lockedjoint.formulations.measures.jacobian import (
    relative_manipulability as relative_manipulability,
)
from lockedjoint.formulations.measures.jacobian import (
    remaining_singular_values as remaining_singular_values,
)
from lockedjoint.formulations.measures.jacobian import (
    residual_sum_of_squares as residual_sum_of_squares,
)
from lockedjoint.formulations.measures.jacobian import sigma_bound as sigma_bound
from lockedjoint.formulations.measures.jacobian import singular_values as singular_values
from lockedjoint.formulations.measures.jacobian import trace as trace
from lockedjoint.formulations.measures.smooth_worst_case import (
    SmoothWorstCases as SmoothWorstCases,
)
from lockedjoint.formulations.measures.smooth_worst_case import (
    smooth_worst_case_batch as smooth_worst_case_batch,
)
from lockedjoint.formulations.measures.worst_failure import WorstCase as WorstCase
from lockedjoint.formulations.measures.worst_failure import WorstCases as WorstCases
from lockedjoint.formulations.measures.worst_failure import (
    weakest_direction as weakest_direction,
)
from lockedjoint.formulations.measures.worst_failure import worst_case as worst_case
from lockedjoint.formulations.measures.worst_failure import worst_case_sigma as worst_case_sigma
from lockedjoint.formulations.measures.worst_failure import (
    worst_case_sigma_batch as worst_case_sigma_batch,
)


def __dir__() -> list[str]:
    return [name for name, value in globals().items() if callable(value) and name[0] != "_"]
