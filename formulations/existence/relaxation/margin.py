"""The largest smallest eigenvalue that free moments can give all moment blocks together.

The margin is the largest s ≤ 1 for which free moments y make B_b(y) − sI ⪰ 0 for all blocks b.
For multipliers X_b ⪰ 0 with Σ tr X_b ≤ 1,

    s ≤ 1 − Σ tr X_b + Σ_b ⟨X_b, B_b(y)⟩,

whose dependence on y should cancel. What is left of it is bounded through |y_k| ≤ Y_k, which
holds for the moments of every solution. A negative right-hand side excludes solutions; an
allowance for the rounding errors of the blocks themselves is added first. cvxpy finds y and
X_b; what they prove is checked in plain NumPy.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from formulations.existence.relaxation.moment_matrix import MomentBlock
from nlp.arrays import FloatArray, finite_or_none
from nlp.conic import run

# Relative rounding of the blocks, which are products of bases with errors of about 1e-12.
_ROUNDING = 1e-10


@dataclass(frozen=True)
class MarginCertificate:
    """What free moments attain, and what multipliers prove impossible.

    Parameters
    ----------
    attained
        Smallest eigenvalue over all blocks at the free moments that were found; minus infinity
        if none were.
    proved
        Upper limit of the margin for moments of solutions; 1 if nothing was proved.
    residual
        Largest coefficient of a free moment that did not cancel.
    smallest_eigenvalue
        Smallest eigenvalue of the multipliers as they were given.
    """

    attained: float
    proved: float
    residual: float
    smallest_eigenvalue: float

    @property
    def feasible(self) -> bool:
        """Whether the moments that were found make every block positive semidefinite."""
        return self.attained >= 0

    @property
    def infeasible(self) -> bool:
        """Whether the multipliers exclude every solution."""
        return self.proved < 0

    def to_dict(self) -> dict[str, float | None]:
        """Return plain values; None stands for an infinite one."""
        return {name: finite_or_none(value) for name, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class Margin:
    """The margin that a solver found, and its check.

    Parameters
    ----------
    value
        The solver's optimum, or None.
    status
        What the solver reported.
    free
        The free moments at the optimum, or None.
    multipliers
        One matrix per block, or None.
    certificate
        What these numbers prove, computed without the solver.
    """

    value: float | None
    status: str
    free: FloatArray | None
    multipliers: tuple[FloatArray, ...] | None
    certificate: MarginCertificate


def solve_margin(
    blocks: Sequence[MomentBlock],
    limits: FloatArray,
    *,
    solver: str = "CLARABEL",
    options: Mapping[str, Any] | None = None,
) -> Margin:
    """Find the margin of some blocks and check it.

    Parameters
    ----------
    blocks
        The blocks, at least one.
    limits
        Limits of the absolute values of the free moments, from `LinearMoments.limits`.
    solver, options
        Conic solver known to cvxpy, and its own options.
    """
    margin = cp.Variable(name="margin")
    unknowns = [cp.Variable() for _ in blocks[0].matrices[1:]]
    semidefinite = [
        sum(
            (y * b for y, b in zip(unknowns, block.matrices[1:], strict=True)),
            block.matrices[0],
        )
        - margin * np.eye(block.size)
        >> 0
        for block in blocks
    ]
    program = cp.Problem(cp.Maximize(margin), [*semidefinite, margin <= 1])
    status = run(program, solver, options)
    value = finite_or_none(program.value)
    free = None if value is None else np.array([y.value for y in unknowns], dtype=float).ravel()
    duals = [constraint.dual_value for constraint in semidefinite]
    multipliers = None
    if all(dual is not None for dual in duals):
        multipliers = tuple(
            np.array(dual, dtype=float).reshape(block.size, block.size)
            for dual, block in zip(duals, blocks, strict=True)
        )
    certificate = check_margin(blocks, limits, free, multipliers)
    return Margin(value, status, free, multipliers, certificate)


def check_margin(
    blocks: Sequence[MomentBlock],
    limits: FloatArray,
    free: FloatArray | None,
    multipliers: Sequence[FloatArray] | None,
) -> MarginCertificate:
    """Return what free moments attain and multipliers prove, wherever they come from.

    Parameters
    ----------
    blocks
        The blocks of the moment matrix.
    limits
        Limits of the absolute values of the free moments.
    free
        Free moments, or None.
    multipliers
        One symmetric matrix per block, or None.
    """
    attained = -math.inf
    if free is not None:
        attained = min(float(np.linalg.eigvalsh(block.at(free))[0]) for block in blocks)
    if multipliers is None or not all(np.isfinite(x).all() for x in multipliers):
        return MarginCertificate(attained, 1.0, math.inf, -math.inf)
    symmetric = [0.5 * (x + x.T) for x in multipliers]
    smallest = min(float(np.linalg.eigvalsh(x)[0]) for x in symmetric)
    positive = [_positive_part(x) for x in symmetric]
    total = sum(float(np.trace(x)) for x in positive)
    if total > 1:
        positive, total = [x / total for x in positive], 1.0
    products = [
        np.tensordot(block.matrices, x, axes=2)
        for block, x in zip(blocks, positive, strict=True)
    ]
    sums = np.sum(products, axis=0)
    leftover = np.abs(sums[1:])
    # What rounding in the blocks can add to Σ⟨X_b, B_b(y)⟩ with Σ tr X_b ≤ 1.
    scale = np.concatenate([[1.0], limits])
    norms = [np.linalg.norm(block.matrices, axis=(1, 2)) @ scale for block in blocks]
    allowance = _ROUNDING * float(max(norms))
    proved = 1 - total + float(sums[0] + leftover @ limits) + allowance
    return MarginCertificate(attained, proved, float(leftover.max(initial=0.0)), smallest)


def _positive_part(matrix: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(matrix)
    positive: FloatArray = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return positive
