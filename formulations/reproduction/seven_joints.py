"""Section 4 and 5, 7R: the nearly optimal Jacobian, eqs. (44)–(46), and whether one is optimal.

Each function yields rows of the report of ``reproduce``: what the paper prints, what is
computed here, and whether the two agree (`row.ReproductionRow`). They are on the residual
minimum and its singular values; on the worst case after a failure, and how far it can be
improved; and on Section 5.

J is the Jacobian of seven revolute joints, shape (6, 7), with columns (v; ω) of |v| = |ω| = 1;
lengths are without a unit. f has the 21 left sides of eqs. (23)–(43), the distinct entries of
JJᵀ − (7/3)I; fᵀf is what the paper minimises. σ_1 ≥ … ≥ σ_6 are singular values of J. The
printed matrices and numbers are in `reference`.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from lockedjoint.formulations import isotropy, max_min, measures, residual
from lockedjoint.formulations.existence.verify import excludes
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.reproduction import reference, row
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import INFEASIBLE
from lockedjoint.nlp.solver import solve

ARM = Arm.of(UnitRevolute(), 7)
# Options of Ipopt. Its tolerance decides how many digits of a residual minimum are right: its
# default 1e-8 would leave too few to compare with the last printed ones.
_OPTIONS = {"tol": 1e-12}
# The paper's own minimisation is converged to about this much in an entry of (44).
_ENTRY = 1e-3
# Joints whose failures leave smallest singular values that differ by less are equally bad.
_TIE = 1e-6
# Values of fᵀf this near to the least one count as equal to it.
_SAME_RESIDUAL = 1e-9
# Singular values of different minima may differ by this and count as the same.
_SAME_SIGMA = 1e-6
# Worst cases this near to the best one count as equal to it; the paper's is improved if ours is
# larger by more.
_SAME_WORST_CASE = 1e-6
# Inner products of columns of equivalent Jacobians agree to this.
_EQUIVALENT_TOLERANCE = 1e-5
# The search for the best frame: number of starts, of which the best counts.
_FRAME_STARTS = 5
# The search for the best frame: tolerance of SciPy's `minimize`.
_FRAME_TOLERANCE = 1e-9
# Relative tolerance with which a J would count as optimally failure tolerant.
_OPTIMAL_TOLERANCE = 1e-8
# The best worst case that eq. (6) allows seven joints.
_OPTIMUM = float(np.sqrt(1 / 3))
_EQUIVALENT = "modulo frame, phase, order and signs"


def minima(seed: int, starts: int) -> list[FloatArray]:
    """Return the Jacobians that the paper's procedure ends at, each of shape (6, 7).

    It minimises fᵀf of the Appendix from random starts.
    """
    build = partial(residual.build, ARM, weighting="paper", rows="appendix")
    return row.optima(row.search(build, ARM.sample, starts, seed, _OPTIONS))


def _refined() -> FloatArray:
    """Return the residual minimum that (44) leads to, in its joint order, shape (6, 7)."""
    start = ARM.variables(reference.nearest_unit_revolute(reference.NEARLY_OPTIMAL_7R))
    return solve(residual.build(ARM), start, _OPTIONS).outputs["jacobian"]


def rows(seed: int = 0, starts: int = 100) -> Iterator[row.ReproductionRow]:
    """Yield the rows of fᵀf = 0.056827 and of eqs. (44) and (45)."""
    where, matrices = "before (44)", minima(seed, starts)
    values = np.array([measures.residual_sum_of_squares(matrix) for matrix in matrices])
    least, minimum = float(values.min()), reference.RESIDUAL_MINIMUM_7R
    note = f"{starts} random starts, the Appendix's equations (f_17 corrected)"
    yield row.to_last_digit(where, "least fᵀf of a 7R", minimum, least, note=note)
    reached = int(np.sum(values <= least + _SAME_RESIDUAL))
    quantity, ours = "random starts that end at this value", f"{reached} of {starts}"
    yield row.claim(where, quantity, "all of several thousand", ours, reached == starts)
    yield from _printed_rows(least, matrices[0])
    spectra = np.array([measures.singular_values(matrix) for matrix in matrices])
    yield from _singular_value_rows(spectra[0])
    spread = float(np.max(np.ptp(spectra, axis=0)))
    classes = len(group_equivalent(matrices, tolerance=_EQUIVALENT_TOLERANCE))
    quantity, true = "the same for all solutions", spread <= _SAME_SIGMA
    ours = f"spread {row.shown_error(spread, _SAME_SIGMA)}; distinct Jacobians: {classes}"
    yield row.claim("(45)", quantity, "common to all", ours, true, _EQUIVALENT)
    sigma = float(np.sqrt(7 / 3))
    yield row.to_last_digit("after (45)", "σ = √(n/3)", reference.ISOTROPIC_SIGMA_7R, sigma)


def _printed_rows(least: float, own: FloatArray) -> Iterator[row.ReproductionRow]:
    """Yield the rows of (44) itself, beside the least fᵀf and a Jacobian `own` that has it."""
    printed, minimum = reference.NEARLY_OPTIMAL_7R, reference.RESIDUAL_MINIMUM_7R
    error, half = reference.column_error(printed), reference.ENTRY_SLACK
    # |v|² moves by at most 2h(|v_x| + |v_y| + |v_z|) + 3h², h the error of an entry, and the
    # sum in brackets is at most √3|v| = √3.
    slack = 2 * half * np.sqrt(3) + 3 * half**2
    quantity = "columns of rotational joints: |v| = |ω| = 1, v·ω = 0"
    ours, note = f"off by at most {error:.1e}", f"rounded entries allow {slack:.1e}"
    yield row.claim("(44)", quantity, "by (21)", ours, error <= slack, note)

    as_printed = measures.residual_sum_of_squares(printed)
    defect, best_frame = measures.isotropy_defect(printed), _least_sum_of_squares(printed)
    slack = reference.defect_slack(printed, defect)
    near = max(abs(defect - least), abs(best_frame - defect)) <= slack
    verdict = row.printed_digits(minimum, as_printed)
    if verdict is not row.Verdict.AGREES and near:
        verdict = row.Verdict.ROUNDED
    yield row.ReproductionRow(
        "(44)",
        "fᵀf of the printed matrix",
        str(minimum),
        f"{row.shown(best_frame)} in its best frame, {row.shown(as_printed)} in the printed "
        "one",
        verdict,
        "fᵀf depends on the frame, and (44) was turned to make its first column simple; "
        f"½‖JJᵀ − (T/6)I‖², which does not, is {row.shown(defect)}, and rounded entries allow "
        f"it to be {slack:.1e} from the minimum {row.shown(least)}",
    )
    exact = _refined()
    same = len(group_equivalent([exact, own], tolerance=_EQUIVALENT_TOLERANCE)) == 1
    moved = float(np.max(np.abs(reference.aligned(exact, printed) - printed)))
    quantity = "the same manipulator Jacobian as ours, refined from the print"
    ours = f"{'the same' if same else 'another'}, entries within {moved:.1e}"
    note = (
        f"{_EQUIVALENT}; beyond rounding (5e-5) the rest is the "
        f"paper's own convergence, allowed {_ENTRY:.0e}"
    )
    true = same and moved <= _ENTRY
    yield row.claim("(44)", quantity, "a typical Jacobian", ours, true, note)


def _least_sum_of_squares(jacobian: FloatArray) -> float:
    """Return the least fᵀf of diag(R, R) P J over rotations R of the frame and phases P.

    The paper's sum of squares depends on the frame; J has shape (6, n). With z = v + iω a phase
    θ takes z to e^{iθ}z.
    """

    def sum_of_squares(x: FloatArray) -> float:
        """Return fᵀf, x the rotation vector of R and then θ, shape (4,), in radians."""
        frame = Rotation.from_rotvec(x[:3]).as_matrix()
        z = np.exp(1j * x[3]) * (frame @ (jacobian[:3] + 1j * jacobian[3:]))
        return measures.residual_sum_of_squares(np.vstack([z.real, z.imag]))

    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (_FRAME_STARTS, 4))
    ends = [minimize(sum_of_squares, start, tol=_FRAME_TOLERANCE) for start in starts]
    return min(float(end.fun) for end in ends)


def _singular_value_rows(exact: FloatArray) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eq. (45), from the singular values of a minimum, shape (6,)."""
    printed, papers = reference.NEARLY_OPTIMAL_7R, reference.SINGULAR_VALUES_7R
    from_print = measures.singular_values(printed)
    slack = reference.singular_value_slack(printed)
    note = f"of the printed matrix (44); rounded entries allow {slack:.1e} from the exact ones"
    paper = ", ".join(map(str, papers))
    yield row.compared("(44)", "singular values", paper, exact, from_print, note, slack)
    for k, value in enumerate(exact):
        rough = from_print[k]
        line = row.to_last_digit("(45)", f"σ_{k + 1}", papers[k], value, rough)
        if line.verdict is row.Verdict.ROUNDED:
            note = (
                f"last digit: the exact value rounds to {value:.4f}, that of (44), "
                f"{rough:.6f}, to {rough:.4f}; rounded to {value:.5f} first and then again "
                "it is the print"
            )
            line = replace(line, note=note)
        yield line


def worst_case_rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eq. (46), of its improvement, and of the search for an optimal 7R."""
    printed, exact = reference.NEARLY_OPTIMAL_7R, _refined()
    value, from_print = (measures.worst_case_sigma(matrix) for matrix in (exact, printed))
    quantity, paper = "smallest singular value after the worst failure", reference.WORST_CASE_7R
    note = f"{row.shown(from_print)} is that of the rounded matrix (44)"
    yield row.to_last_digit("(46)", quantity, paper, value, from_print, note)

    from_print, expected = measures.worst_case(printed).joints[0] + 1, reference.WORST_JOINT_7R
    sigmas = measures.locked_singular_values(exact)
    worst = np.flatnonzero(sigmas <= sigmas.min() + _TIE) + 1
    verdict = row.holds(expected in worst)
    if verdict is row.Verdict.AGREES and worst.size > 1:
        verdict = row.Verdict.ROUNDED if from_print == expected else row.Verdict.MISMATCH
    said, ours = f"joint {expected}", "joints " + ", ".join(map(str, worst)) + " alike"
    note = f"in the rounded matrix joint {from_print} is worst; exactly, these all are"
    yield row.ReproductionRow("(46)", "the worst joint", said, ours, verdict, note)

    where, optimum = "after (46)", reference.OPTIMAL_SIGMA_7R
    yield row.to_last_digit(where, "optimum √(1/3)", optimum, _OPTIMUM)
    poorer, percent = measures.gap_percent(value, _OPTIMUM), reference.POORER_PERCENT_7R
    quantity = "percent by which (46) is poorer than the optimum"
    line = row.to_last_digit(where, quantity, percent, poorer)
    yield replace(line, paper=f"approximately {percent}")
    yield _improvement_row(value, seed, starts)
    yield _existence_row(seed, starts)


def _improvement_row(before: float, seed: int, starts: int) -> row.ReproductionRow:
    """Return the row of max-min from residual minima, whose worst case is σ = `before`."""
    build, sample = partial(max_min.build, ARM), partial(residual.minimum, ARM)
    answers = row.optima(row.search(build, sample, starts, seed))
    sigmas = np.array([measures.worst_case_sigma(matrix) for matrix in answers])
    best = float(sigmas.max())
    reached = int(np.sum(sigmas >= best - _SAME_WORST_CASE))
    gaps = [measures.gap_percent(sigma, _OPTIMUM) for sigma in (before, best)]
    return row.ReproductionRow(
        "after (46)",
        "worst case if (5) is optimised explicitly",
        f"slightly better than {reference.WORST_CASE_7R}",
        row.shown(best),
        row.improvement(before, best, _SAME_WORST_CASE),
        f"max-min, {reached} of {starts} starts from residual minima reach it: "
        f"{100 * (best / before - 1):.4f} % better than {row.shown(before)}, and "
        f"{gaps[1]:.4f} % instead of {gaps[0]:.4f} % below √(1/3)",
    )


def _existence_row(seed: int, starts: int) -> row.ReproductionRow:
    """Return the row of the paper's open question, whether there is an optimal 7R.

    Isotropy is asked for as constraints from random starts, and the proof that no such
    Jacobian exists is verified.
    """
    solutions = row.search(partial(isotropy.build, ARM), ARM.sample, starts, seed)
    matrices = (solution.outputs["jacobian"] for solution in solutions)
    tolerant = any(
        measures.is_optimally_failure_tolerant(j, _OPTIMAL_TOLERANCE) for j in matrices
    )
    least = min(solution.violation for solution in solutions)
    infeasible = sum(solution.status.return_status == INFEASIBLE for solution in solutions)
    proved = excludes(len(ARM.joints))
    # The open question is answered one way, or the other, and not both.
    answered = row.Verdict.IMPROVED if tolerant or proved else row.Verdict.AGREES
    return row.ReproductionRow(
        "Sec. 5",
        "optimally failure-tolerant 7R of rotational joints",
        "not found",
        "found" if tolerant else "proved not to exist" if proved else "not found",
        row.Verdict.MISMATCH if tolerant and proved else answered,
        f"isotropy as constraints: {infeasible} of {starts} starts end as {INFEASIBLE}, least "
        f"violation {row.shown(least)}; the certificate that none exists "
        + ("was verified in this run" if proved else "does not speak of this arm"),
    )
