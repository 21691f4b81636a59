"""The independent judge: what a Jacobian is worth, from the matrix alone (NumPy only).

The measures of one Jacobian, in `jacobian`, are offered here: ``measures.worst_case_sigma(J)``.
"""

from formulations.measures.jacobian import (
    WorstCase as WorstCase,
)
from formulations.measures.jacobian import (
    as_jacobian as as_jacobian,
)
from formulations.measures.jacobian import (
    averaged_spectrum as averaged_spectrum,
)
from formulations.measures.jacobian import (
    condition_number as condition_number,
)
from formulations.measures.jacobian import (
    eigenvalue_bound as eigenvalue_bound,
)
from formulations.measures.jacobian import (
    gap_percent as gap_percent,
)
from formulations.measures.jacobian import (
    is_optimally_failure_tolerant as is_optimally_failure_tolerant,
)
from formulations.measures.jacobian import (
    isotropy_defect as isotropy_defect,
)
from formulations.measures.jacobian import (
    locked_singular_values as locked_singular_values,
)
from formulations.measures.jacobian import (
    manipulability as manipulability,
)
from formulations.measures.jacobian import (
    null_space_contributions as null_space_contributions,
)
from formulations.measures.jacobian import (
    range_contributions as range_contributions,
)
from formulations.measures.jacobian import (
    relative_manipulability as relative_manipulability,
)
from formulations.measures.jacobian import (
    residual_sum_of_squares as residual_sum_of_squares,
)
from formulations.measures.jacobian import (
    sigma_bound as sigma_bound,
)
from formulations.measures.jacobian import (
    singular_values as singular_values,
)
from formulations.measures.jacobian import (
    trace as trace,
)
from formulations.measures.jacobian import (
    worst_case as worst_case,
)
from formulations.measures.jacobian import (
    worst_case_sigma as worst_case_sigma,
)
