"""Section 3: positional 4R (18)–(19), the canonical Jacobian (20), and the search for a U.

No orthogonal U was found that turns (20) into a Jacobian of revolute joints::

    minimise   Σ_i (v_i·ω_i)² + ¼(|v_i|² − |ω_i|²)²      over U, 6×6
    subject to UUᵀ = I

with (v_i; ω_i) the columns of √(7/3) U J, J from (20), whose norms² are 2. The sum is zero
exactly where every column is that of a revolute joint with |v| = |ω| = 1, eq. (21). Other
lever arms would not help: |ω_i| = 1 for every revolute joint, so JJᵀ = σ²I has 3σ² = n, and
columns of equal norm have norm² 6σ²/n = 2, which leaves |v_i| = 1.
"""

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from formulations import measures
from formulations.reproduction import reference, row
from formulations.reproduction.searches import search
from nlp.arrays import FloatArray
from nlp.problem import Constraint, Problem

# A sum of squares below this would be a revolute Jacobian.
_REVOLUTE = 1e-12


def positional_rows() -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (18) and (19)."""
    matrix = reference.POSITIONAL_4R
    error = float(np.max(np.abs(matrix @ matrix.T - np.eye(4))))
    yield row.within("(18)", "VᵀV = I", "orthogonal", error)
    unit = matrix[:3] / np.linalg.norm(matrix[:3], axis=0)
    cosines = (unit.T @ unit)[np.triu_indices(4, 1)]
    quantity, paper = "cosines between the columns", "span space symmetrically"
    note = "all −1/3: the corners of a regular tetrahedron"
    yield row.compared("(18)", quantity, paper, -1 / 3, cosines, note)
    sigmas, expected = (
        measures.locked_singular_values(matrix[:3]),
        reference.POSITIONAL_4R_SIGMA,
    )
    paper = f"1/2 = {row.shown(expected)}"
    yield row.compared("(19)", "fσ_3 for f = 1, …, 4", paper, expected, sigmas)


def canonical_rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Rows of eq. (20) and of the claims around it, but for the search for a U."""
    jacobian, show = reference.CANONICAL_6X7, row.shown_range
    values = measures.singular_values(jacobian)
    yield row.compared("(20)", "singular values", "σ = 1, isotropic", 1, values)
    shares = measures.null_space_contributions(jacobian)
    yield row.compared("(20)", "N_i, i = 1, …, 7", "equal, so 1/7", 1 / 7, shares, show=show)
    sigmas, expected = measures.locked_singular_values(jacobian), np.sqrt(1 / 7)
    quantity, paper = "fσ_6 for f = 1, …, 7", f"√(1/7) = {row.shown(expected)}"
    note = "eq. (6) with equality"
    yield row.compared("(20)", quantity, paper, expected, sigmas, note, show=show)
    error = float(np.max(np.abs(jacobian - reference.simplex_jacobian(6))))
    shares = _shares([reference.simplex_jacobian(m) for m in range(1, 13)])
    yield row.claim(
        "(20)",
        "the same pattern for m = 1, …, 12, n = m + 1: worst case over √((n−m)/n)",
        "a task space of any dimension",
        row.farthest(1)(shares),
        max(error, *np.abs(shares - 1)) <= row.ROUNDING,
        f"regular simplex; for m = 6, n = 7 the print {row.shown_error(error)}",
    )
    sizes = [(m, n) for m in range(1, 9) for n in range(m + 1, 17)]
    yield row.compared(
        "(20)",
        "m = 1, …, 8, n = m + 1, …, 16: worst case over √((n−m)/n)",
        "a manipulator of any dimension",
        1,
        _shares([reference.harmonic_jacobian(m, n) for m, n in sizes]),
        "the paper prints n = m + 1 only; our construction for n > m + 1: harmonic frames",
        show=row.farthest(1),
    )
    pitch = np.abs(np.sum(jacobian[:3] * jacobian[3:], axis=0))
    rotates = np.linalg.norm(jacobian[3:], axis=0) > row.ROUNDING
    screws, revolute = pitch > row.ROUNDING, rotates & (pitch <= row.ROUNDING)
    quantity = "columns of (20) that a revolute joint can contribute"
    paper, ours, true = "none: arbitrary screws", np.sum(revolute), not np.any(revolute)
    note = f"{np.sum(screws)} columns are screws with v·ω ≠ 0, {np.sum(~rotates)} have ω = 0"
    yield row.claim("after (20)", quantity, paper, ours, true, note)
    rng = np.random.default_rng(seed)
    factors = np.linalg.qr(rng.standard_normal((100, 6, 6)))[0]
    after = [measures.locked_singular_values(factor @ jacobian) for factor in factors]
    change = float(np.max(np.abs(np.array(after) - sigmas)))
    quantity = "change of fσ_6 under UJ, U orthogonal"
    yield row.within("after (20)", quantity, "none", change, "100 random U")


def _shares(matrices: Sequence[FloatArray]) -> FloatArray:
    """Return the worst case of each Jacobian as a share of √((n−m)/n)."""
    optima = [np.sqrt(1 - len(matrix) / matrix.shape[1]) for matrix in matrices]
    return np.divide([measures.worst_case_sigma(matrix) for matrix in matrices], optima)


def rotation() -> Problem:
    """State the search for U, with the columns of (20) scaled to norm² 2."""
    jacobian = reference.CANONICAL_6X7
    n = jacobian.shape[1]
    factor = ca.SX.sym("U", 6, 6)
    product = factor @ ca.DM(np.sqrt(n / 3) * jacobian)
    velocity, axis = product[:3, :], product[3:, :]
    products = ca.sum1(velocity * axis)
    excess = ca.sum1(velocity**2) - ca.sum1(axis**2)
    gram = factor @ factor.T - ca.SX.eye(6)
    orthogonality = ca.vertcat(*(gram[i, j] for i in range(6) for j in range(i + 1)))
    return Problem(
        name="rotation into revolute joints",
        variables=ca.vec(factor),
        objective=ca.sumsqr(products) + ca.sumsqr(excess) / 4,
        constraints=(Constraint("orthogonality", orthogonality, 0.0, 0.0),),
        outputs={"jacobian": product},
    )


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """Draw an orthogonal U, uniformly; its entries, shape (36,)."""
    factor, triangle = np.linalg.qr(rng.standard_normal((6, 6)))
    return np.asarray((factor * np.sign(np.diag(triangle))).ravel())


def violation(jacobian: FloatArray) -> float:
    """Return the sum that `rotation` minimises, from the matrix alone."""
    velocity, axis = jacobian[:3], jacobian[3:]
    excess = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return float(np.sum(np.sum(velocity * axis, axis=0) ** 2) + np.sum(excess**2) / 4)


def rotation_rows(seed: int = 0, starts: int = 40) -> Iterator[row.ReproductionRow]:
    """Row of the attempt to rotate (20) into a Jacobian of revolute joints."""
    solutions = search(rotation, random_rotation, starts, seed)
    feasible = [solution for solution in solutions if solution.violation <= 1e-7]
    sums = np.array([violation(solution.outputs["jacobian"]) for solution in feasible])
    least = float(np.min(sums, initial=np.inf))
    same = int(np.sum(sums <= least + 1e-6))
    improved = least <= _REVOLUTE
    yield row.ReproductionRow(
        "after (20)",
        "least violation of v·ω = 0, |v| = |ω| = 1 over all UJ, sum of squares",
        "no U identified",
        row.shown(least),
        row.Verdict.IMPROVED if improved else row.holds(bool(np.isfinite(least))),
        f"columns scaled to norm² 2; {same} of {starts} random U end at this value, none "
        "lower; a numerical search, not a proof",
    )
