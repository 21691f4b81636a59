"""Section 3, end: no orthogonal U was found that turns (20) into one of revolute joints.

::

    minimise   Σ_i (v_i·ω_i)² + ¼(|v_i|² − |ω_i|²)²      over U, 6×6
    subject to UUᵀ = I

with (v_i; ω_i) the columns of √(7/3) U J, J from (20), whose norms² are 2. The sum is zero
exactly where every column is that of a revolute joint with |v| = |ω| = 1, eq. (21). Other
lever arms would not help: |ω_i| = 1 for every revolute joint, so JJᵀ = σ²I has 3σ² = n, and
columns of equal norm have norm² 6σ²/n = 2, which leaves |v_i| = 1.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from formulations.reproduction import reference
from formulations.reproduction.row import Row, Verdict, shown
from formulations.reproduction.searches import search
from nlp.arrays import FloatArray
from nlp.problem import Constraint, Problem

# A sum of squares below this would be a revolute Jacobian.
FOUND = 1e-12


def build(jacobian: FloatArray = reference.CANONICAL_6X7) -> Problem:
    """State the problem for a 6×n Jacobian with JJᵀ = I, columns scaled to norm² 2."""
    n = jacobian.shape[1]
    turn = ca.SX.sym("U", 6, 6)
    turned = turn @ ca.DM(np.sqrt(n / 3) * jacobian)
    velocity, axis = turned[:3, :], turned[3:, :]
    products = ca.sum1(velocity * axis)
    excess = ca.sum1(velocity**2) - ca.sum1(axis**2)
    gram = turn @ turn.T - ca.SX.eye(6)
    orthogonality = ca.vertcat(*(gram[i, j] for i in range(6) for j in range(i + 1)))
    return Problem(
        name="rotation into revolute joints",
        variables=ca.vec(turn),
        objective=ca.sumsqr(products) + ca.sumsqr(excess) / 4,
        constraints=(Constraint("orthogonality", orthogonality, 0.0, 0.0),),
        outputs={"jacobian": turned},
    )


def sample(rng: np.random.Generator) -> FloatArray:
    """Draw an orthogonal U, uniformly; its entries, shape (36,)."""
    factor, triangle = np.linalg.qr(rng.standard_normal((6, 6)))
    return np.asarray((factor * np.sign(np.diag(triangle))).ravel())


def violation(jacobian: FloatArray) -> float:
    """Return the sum that `build` minimises, from the matrix alone."""
    velocity, axis = jacobian[:3], jacobian[3:]
    excess = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return float(np.sum(np.sum(velocity * axis, axis=0) ** 2) + np.sum(excess**2) / 4)


def rows(
    seed: int = 0, starts: int = 40, jacobian: FloatArray = reference.CANONICAL_6X7
) -> Iterator[Row]:
    """Row of the attempt to rotate (20)."""
    found = search(lambda: build(jacobian), sample, starts=starts, seed=seed)
    feasible = [solution for solution in found if solution.violation <= 1e-7]
    sums = np.array([violation(solution.outputs["jacobian"]) for solution in feasible])
    least = float(np.min(sums, initial=np.inf))
    same = int(np.sum(sums <= least + 1e-6))
    verdict = Verdict.AGREES if np.isfinite(least) else Verdict.MISMATCH
    if least <= FOUND:
        verdict = Verdict.IMPROVED
    yield Row(
        "after (20)",
        "least violation of v·ω = 0, |v| = |ω| = 1 over all UJ, sum of squares",
        "no U identified",
        shown(least),
        verdict,
        f"columns scaled to norm² 2; {same} of {starts} random U end at this value, none "
        "lower; a numerical search, not a proof",
    )
