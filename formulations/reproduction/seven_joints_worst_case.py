"""Section 4, 7R after a failure: eq. (46), how far it can be improved, and Section 5."""

from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from functools import partial

import numpy as np

from formulations import isotropy, max_min, measures
from formulations.existence.theorem import excludes
from formulations.reproduction import reference
from formulations.reproduction.row import (
    ReproductionRow,
    Verdict,
    holds,
    improvement,
    shown,
    to_last_digit,
)
from formulations.reproduction.searches import optima, search
from formulations.reproduction.seven_joints import ARM, refined
from nlp.arrays import FloatArray
from nlp.solution import INFEASIBLE

# Joints whose failure leaves the same smallest singular value, to this difference.
_TIE = 1e-6
BOUND = float(np.sqrt(1 / 3))


def rows(
    seed: int = 0,
    starts: int = 20,
    printed: FloatArray = reference.NEARLY_OPTIMAL_7R,
    worst_case: Decimal = reference.WORST_CASE_7R,
) -> Iterator[ReproductionRow]:
    """Rows of eq. (46), of its improvement, and of the search for an optimal 7R."""
    exact = refined(printed)
    value, from_print = (measures.worst_case_sigma(matrix) for matrix in (exact, printed))
    quantity = "smallest singular value after the worst failure"
    note = f"{shown(from_print)} is that of the rounded matrix (44)"
    yield to_last_digit("(46)", quantity, worst_case, value, from_print, note)
    yield _worst_joint_row(printed, exact)
    yield to_last_digit("after (46)", "optimum √(1/3)", reference.OPTIMAL_SIGMA_7R, BOUND)
    poorer, percent = measures.gap_percent(value, BOUND), reference.POORER_PERCENT_7R
    quantity = "percent by which (46) is poorer than the optimum"
    row = to_last_digit("after (46)", quantity, percent, poorer)
    yield replace(row, paper=f"approximately {percent}")
    yield _improvement_row(exact, seed, starts)
    yield _existence_row(seed, starts)


def _worst_joint_row(printed: FloatArray, exact: FloatArray) -> ReproductionRow:
    from_print = measures.worst_case(printed).joints[0] + 1
    sigmas = measures.locked_singular_values(exact)
    worst = np.flatnonzero(sigmas <= sigmas.min() + _TIE) + 1
    expected = reference.WORST_JOINT_7R
    verdict = holds(expected in worst)
    if verdict is Verdict.AGREES and worst.size > 1:
        verdict = Verdict.ROUNDED if from_print == expected else Verdict.MISMATCH
    ours = "joints " + ", ".join(map(str, worst)) + " alike"
    note = f"in the rounded matrix joint {from_print} is worst; exactly, these all are"
    return ReproductionRow("(46)", "the worst joint", f"joint {expected}", ours, verdict, note)


def _improvement_row(exact: FloatArray, seed: int, starts: int) -> ReproductionRow:
    build, sample = partial(max_min.build, ARM), max_min.ResidualMinimum(ARM)
    found = optima(search(build, sample, starts, seed))
    sigmas = np.array([measures.worst_case_sigma(matrix) for matrix in found])
    best, before = float(sigmas.max()), measures.worst_case_sigma(exact)
    reached = int(np.sum(sigmas >= best - 1e-6))
    gaps = [measures.gap_percent(sigma, BOUND) for sigma in (before, best)]
    return ReproductionRow(
        "after (46)",
        "worst case if (5) is optimised explicitly",
        f"slightly better than {reference.WORST_CASE_7R}",
        shown(best),
        improvement(before, best, 1e-6),
        f"max-min, {reached} of {starts} starts from residual minima reach it: "
        f"{100 * (best / before - 1):.4f} % better than {shown(before)}, and "
        f"{gaps[1]:.4f} % instead of {gaps[0]:.4f} % below √(1/3)",
    )


def _existence_row(seed: int, starts: int) -> ReproductionRow:
    build = partial(isotropy.build, ARM)
    found = search(build, ARM.sample, starts, seed)
    tolerant = any(
        measures.is_optimally_failure_tolerant(solution.outputs["jacobian"], 1e-8)
        for solution in found
    )
    least = min(solution.violation for solution in found)
    infeasible = sum(solution.status.return_status == INFEASIBLE for solution in found)
    proved = excludes(len(ARM.joints))
    return ReproductionRow(
        "Sec. 5",
        "optimally failure-tolerant 7R of rotational joints",
        "not found",
        "found" if tolerant else "proved not to exist" if proved else "not found",
        _existence_verdict(tolerant, proved),
        f"isotropy as constraints: {infeasible} of {starts} starts end as {INFEASIBLE}, least "
        f"violation {shown(least)}; the certificate that none exists "
        + ("was verified in this run" if proved else "does not speak of this arm"),
    )


def _existence_verdict(found: bool, proved: bool) -> Verdict:
    """Return IMPROVED where the open question is answered, one way and not both."""
    if found and proved:
        return Verdict.MISMATCH
    return Verdict.IMPROVED if found or proved else Verdict.AGREES
