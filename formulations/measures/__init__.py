"""Failure tolerance of a Jacobian, from the matrix alone (Section 2, eqs. 3–11 and 15).

The independent judge of every solution: plain NumPy, no solver, no model of the joints.
Jacobians are arrays of shape (m, n) with n > m; joints are counted from 0.
"""

from formulations.measures.jacobian import (
    as_jacobian,
    averaged_spectrum,
    condition_number,
    eigenvalue_bound,
    gap_percent,
    is_optimally_failure_tolerant,
    isotropy_defect,
    locked_sets,
    locked_singular_values,
    manipulability,
    null_space_contributions,
    range_contributions,
    relative_manipulability,
    remaining_singular_values,
    residual_sum_of_squares,
    sigma_bound,
    singular_values,
    trace,
)
from formulations.measures.worst_failure import (
    WorstCase,
    WorstCases,
    weakest_direction,
    worst_case,
    worst_case_sigma,
    worst_case_sigma_batch,
)

__all__ = [
    "WorstCase",
    "WorstCases",
    "as_jacobian",
    "averaged_spectrum",
    "condition_number",
    "eigenvalue_bound",
    "gap_percent",
    "is_optimally_failure_tolerant",
    "isotropy_defect",
    "locked_sets",
    "locked_singular_values",
    "manipulability",
    "null_space_contributions",
    "range_contributions",
    "relative_manipulability",
    "remaining_singular_values",
    "residual_sum_of_squares",
    "sigma_bound",
    "singular_values",
    "trace",
    "weakest_direction",
    "worst_case",
    "worst_case_sigma",
    "worst_case_sigma_batch",
]


def __dir__() -> list[str]:
    return __all__
