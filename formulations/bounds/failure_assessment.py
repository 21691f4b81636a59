"""What a failure model says of one Jacobian, beside the bounds, as one plain record."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.bounds.unequal_failures import (
    expected_bound,
    possible_worst_bound,
    weighted_worst_bound,
)
from formulations.measures import unequal_failures
from formulations.measures.failure_model import FailureModel


@dataclass(frozen=True)
class FailureAssessment:
    """Measures of `failure_measures`, as plain numbers.

    Attributes
    ----------
    failure_probabilities
        Of each joint; None where all that may fail are alike.
    never_failing_joints
        Counted from 0.
    possible_worst_sigma, possible_worst_bound
        Worst case over the failures that can happen, and its bound for columns of J's norms.
    weighted_worst_sigma, weighted_worst_joints, weighted_worst_bound
        Least σ_F/w_F, where, and its bound.
    expected_sigma, expected_bound
        Mean of σ_F given that exactly k joints fail, and a bound that is not sharp.
    overall_expected_sigma, covered_probability
        Mean of σ over up to k failures, none included, more counted as zero, and the
        probability of up to k; None without probabilities.
    """

    failure_probabilities: list[float] | None
    never_failing_joints: list[int]
    possible_worst_sigma: float
    possible_worst_bound: float
    weighted_worst_sigma: float
    weighted_worst_joints: list[int]
    weighted_worst_bound: float
    expected_sigma: float
    expected_bound: float
    overall_expected_sigma: float | None
    covered_probability: float | None

    def to_dict(self) -> dict[str, object]:
        """Return the fields as a dictionary of plain values."""
        return asdict(self)


def assess_failures(
    jacobian: npt.ArrayLike, failures: FailureModel, *, probabilities_known: bool = True
) -> FailureAssessment:
    """Measure everything at once.

    Parameters
    ----------
    jacobian
        Shape (m, n), n > m.
    failures
        Which joints may fail, how likely, and how many at once.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.
    """
    matrix = measures.as_jacobian(jacobian)
    weighted, joints = unequal_failures.weighted_worst_case(matrix, failures)
    m, norms = matrix.shape[0], np.sum(matrix**2, axis=0).tolist()
    known = probabilities_known
    overall = unequal_failures.overall_expected_sigma(matrix, failures) if known else None
    return FailureAssessment(
        failure_probabilities=list(failures.probabilities) if known else None,
        never_failing_joints=[i for i, p in enumerate(failures.probabilities) if p == 0],
        possible_worst_sigma=unequal_failures.possible_worst_case_sigma(matrix, failures),
        possible_worst_bound=possible_worst_bound(m, norms, failures),
        weighted_worst_sigma=weighted,
        weighted_worst_joints=list(joints),
        weighted_worst_bound=weighted_worst_bound(m, norms, failures),
        expected_sigma=unequal_failures.expected_sigma(matrix, failures),
        expected_bound=expected_bound(m, norms, failures),
        overall_expected_sigma=overall,
        covered_probability=unequal_failures.covered_probability(failures) if known else None,
    )
