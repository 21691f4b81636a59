"""Section 4, after eq. (46): "entire families" of optimally failure-tolerant 8R Jacobians."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.measures.canonical import distinct
from formulations.reproduction import reference
from formulations.reproduction.eight_joints import ARM, polished, solutions
from formulations.reproduction.nearest import nearest_unit_revolute
from formulations.reproduction.row import Row, Verdict, shown
from formulations.reproduction.solution_family import (
    fills_tangent_space,
    local_dimension,
    solve_near,
    trace_family,
)
from formulations.reproduction.verdicts import holds
from nlp.arrays import FloatArray
from nlp.errors import InputError

_TOLERANCE = 1e-9
_DISTINCT = 1e-3


def rows(
    seed: int = 0,
    starts: int = 50,
    steps: int = 20,
    printed: FloatArray = reference.OPTIMAL_8R,
) -> Iterator[Row]:
    """Rows of the family that the printed Jacobian (47) belongs to, and of the others."""
    try:
        start = solve_near(ARM, ARM.variables(nearest_unit_revolute(printed)))
    except InputError as reason:
        quantity, paper = "solutions near the printed one", "entire families"
        yield Row("after (46)", quantity, paper, "none", Verdict.MISMATCH, str(reason))
        return
    yield _dimension_row(start)
    yield _curve_row(start, steps)
    yield _kinds_row(seed, starts)


def _dimension_row(start: FloatArray) -> Row:
    size = local_dimension(ARM, start)
    filled = fills_tangent_space(ARM, start)
    return Row(
        "after (46)",
        "dimension of the family of 8R optima around (47)",
        "entire families",
        f"{size.family} = {size.angles} angles − {size.symmetries} symmetries − "
        f"{size.equations} equations",
        holds(size.family >= 1 and filled),
        "ranks at the exact solution next to (47); solutions of the same rank were found in "
        f"{'every' if filled else 'not every'} tangent direction. Of 18 equations only "
        f"{size.equations} are independent here",
    )


def _kinds_row(seed: int, starts: int) -> Row:
    points = [polished(solution) for solution in solutions(8, seed, starts)]
    sizes = Counter(local_dimension(ARM, point).family for point in points)
    ours = ", ".join(f"{size} for {count}" for size, count in sorted(sizes.items()))
    return Row(
        "after (46)",
        f"dimensions of the families around {starts} own 8R optima",
        "entire families",
        ours,
        holds(min(sizes) >= 1),
        "by rank; 18 independent equations leave two dimensions, a third where their "
        "derivatives are dependent",
    )


def _curve_row(start: FloatArray, steps: int) -> Row:
    try:
        points = trace_family(ARM, start, steps)
    except InputError as reason:
        return Row("after (46)", "a curve", "exists", "none", Verdict.MISMATCH, str(reason))
    matrices = [ARM.jacobian(point) for point in points]
    classes = len(distinct(matrices, tolerance=_DISTINCT))
    tolerant = all(
        measures.is_optimally_failure_tolerant(matrix, _TOLERANCE) for matrix in matrices
    )
    sigmas = np.array([measures.worst_case_sigma(matrix) for matrix in matrices])
    farthest = sigmas[np.argmax(np.abs(sigmas - reference.WORST_CASE_8R))]
    return Row(
        "after (46)",
        f"distinct Jacobians among {len(matrices)} along a curve of 8R optima from (47)",
        "entire families",
        str(classes),
        holds(tolerant and classes == len(matrices)),
        f"each optimally failure tolerant to {_TOLERANCE:.0e}; fσ_6 farthest from √(2/3): "
        f"{shown(farthest)}; inner products of any two differ by more than {_DISTINCT:.0e}",
    )
