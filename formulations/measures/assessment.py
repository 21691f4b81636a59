"""All measures of one Jacobian, as one plain record."""

from dataclasses import asdict, dataclass
from html import escape
from itertools import combinations

import numpy.typing as npt

from lockedjoint.formulations import measures
from lockedjoint.formulations.io.table import written


@dataclass(frozen=True, repr=False)
class Assessment:
    """Everything measured of one Jacobian J, shape (m, n), as plain numbers.

    A field that is not listed is what the function of that name in `measures` returns. σ has
    the units of J.

    Attributes
    ----------
    task_dimension, joints, failures
        m, n, and how many joints lock at once, k.
    locked_sigmas
        The smallest singular value that each set of locked joints leaves, sets in
        lexicographic order.
    worst_case_joints, worst_case_sets
        Every joint, counted from 0, that is in a worst set, and the worst sets: several where
        they tie.
    worst_case_direction
        The unit vector, m numbers, along which the worst failure leaves the least.
    optimally_failure_tolerant, tolerance
        `measures.is_optimally_failure_tolerant`, and the relative tolerance of it.
    """

    task_dimension: int
    joints: int
    failures: int
    singular_values: list[float]
    condition_number: float
    manipulability: float
    locked_sigmas: list[float]
    worst_case_sigma: float
    worst_case_joints: list[int]
    worst_case_sets: list[list[int]]
    worst_case_direction: list[float]
    sigma_bound: float
    gap_percent: float
    isotropy_defect: float
    residual_sum_of_squares: float
    range_contributions: list[float]
    null_space_contributions: list[float]
    relative_manipulability: list[float]
    optimally_failure_tolerant: bool
    tolerance: float

    def to_dict(self) -> dict[str, object]:
        """Return the fields as a dictionary of plain values."""
        return asdict(self)

    def __repr__(self) -> str:
        """Say in one line what counts: the worst case, its joints, and the gap."""
        joints = ", ".join(map(str, self.worst_case_joints))
        locked = f"{self.failures} of joints" if self.failures > 1 else "joint"
        return (
            f"<Assessment: {self.task_dimension}×{self.joints}, worst case σ = "
            f"{self.worst_case_sigma:.6g} ({locked} {joints} locked), "
            f"{self.gap_percent:.3g} % below the bound (6) {self.sigma_bound:.6g}>"
        )

    def _repr_html_(self) -> str:
        """Return the line and what the worst failures leave, for notebooks."""
        sets = combinations(range(self.joints), self.failures)
        names = [", ".join(map(str, joints)) for joints in sets]
        pairs = zip(names, self.locked_sigmas, strict=True)
        worst = sorted(pairs, key=lambda pair: pair[1])[:10]
        cells = [[name, f"{sigma:.6f}"] for name, sigma in worst]
        table = written(cells, ["locked", "σ left"], "html")
        return f"<p>{escape(repr(self))}</p>{table}"


def measure(jacobian: npt.ArrayLike, failures: int = 1, tolerance: float = 1e-6) -> Assessment:
    """Measure how failure tolerant a Jacobian is: everything at once.

    Parameters
    ----------
    jacobian
        Shape (m, n), n > m.
    failures
        How many joints lock at once.
    tolerance
        Relative tolerance of the verdict 'optimally failure tolerant'.

    Raises
    ------
    InputError
        If it is no Jacobian, or so many joints cannot lock.

    Examples
    --------
    >>> measure([[1, 0, 1], [0, 1, 1]]).worst_case_joints
    [0, 1]
    """
    matrix = measures.as_jacobian(jacobian)
    m, n = matrix.shape
    worst = measures.worst_case(matrix, failures)
    bound = measures.sigma_bound(m, n, measures.trace(matrix), failures)
    return Assessment(
        task_dimension=m,
        joints=n,
        failures=failures,
        singular_values=measures.singular_values(matrix).tolist(),
        condition_number=measures.condition_number(matrix),
        manipulability=measures.manipulability(matrix),
        locked_sigmas=measures.locked_singular_values(matrix, failures).tolist(),
        worst_case_sigma=worst.sigma,
        worst_case_joints=sorted({joint for joints in worst.sets for joint in joints}),
        worst_case_sets=[list(joints) for joints in worst.sets],
        worst_case_direction=worst.direction.tolist(),
        sigma_bound=bound,
        gap_percent=measures.gap_percent(worst.sigma, bound),
        isotropy_defect=measures.isotropy_defect(matrix),
        residual_sum_of_squares=measures.residual_sum_of_squares(matrix),
        range_contributions=measures.range_contributions(matrix).tolist(),
        null_space_contributions=measures.null_space_contributions(matrix).tolist(),
        relative_manipulability=measures.relative_manipulability(matrix, failures).tolist(),
        optimally_failure_tolerant=measures.is_optimally_failure_tolerant(matrix, tolerance),
        tolerance=tolerance,
    )
