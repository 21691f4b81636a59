"""A basis of all invariants of a degree, good enough to bound an invariant by a few values.

Let V be a space of invariants of known dimension D (see `invariant_dimension`), and e_1 … e_D
combinations of averaged block entries, e_j = Σ_b ⟨T_jb, B_b⟩, which lie in V. If their values
at points x_1 … x_P, known up to small errors, have a left inverse R, they are a basis, and
f ∈ V with values f_i there is Σ c_j e_j with |c| ≤ |R f|/(1 − q), where q bounds ‖RG − I‖ for
the exact matrix G of values. For the blocks of one sector Σ_b d_b tr B_b(x) ≤ τ, where d_b is
the number of tableaux, and B_b ⪰ 0. So

    |f(x)| ≤ |c| Σ_sectors τ max_b ‖T_b‖/d_b   for every configuration x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    SAFETY,
    EnclosedBlock,
    enclosed_block,
    product_error,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.representations.rounding import gamma
from nlp.arrays import FloatArray
from nlp.errors import LockedJointError


class NoBasisError(LockedJointError):
    """The values at the points do not prove that the functions are a basis."""


@dataclass(frozen=True, eq=False)
class InvariantBasis:
    """What is needed to bound an invariant by its values at the points.

    Parameters
    ----------
    left_inverse
        R, shape (dimension, points).
    defect
        Bound on ‖RG − I‖ for the exact matrix of values G; below 1.
    amplification
        Σ τ max_b ‖T_b‖/d_b, so that |f| ≤ amplification · |c|.
    """

    left_inverse: FloatArray
    defect: float
    amplification: float

    def largest_value(self, values: FloatArray, errors: FloatArray) -> float:
        """Bound |f| over all configurations by its values at the points and their errors."""
        norm = float(np.linalg.norm(self.left_inverse, 2))
        # Rounding of R · values is relative to |R|, whose 2-norm is at most the Frobenius norm.
        rounding = gamma(len(values) + 2) * float(np.linalg.norm(self.left_inverse))
        coefficients = float(np.linalg.norm(self.left_inverse @ values))
        coefficients += norm * float(np.linalg.norm(errors))
        coefficients += rounding * float(np.linalg.norm(values))
        return SAFETY**2 * self.amplification * coefficients / (1.0 - self.defect)


def invariant_basis(
    families: Sequence[SectorBlocks], rotations: FloatArray, dimension: int
) -> InvariantBasis:
    """Return a basis of a space of invariants of known dimension.

    Parameters
    ----------
    families
        Blocks whose entries, averaged, lie in the space and span it.
    rotations
        The points, (points, n, 3, 3), more than `dimension`.
    dimension
        D.

    Raises
    ------
    NoBasisError
        If the values do not prove that there is a basis.
    """
    points = len(rotations)
    blocks: list[tuple[int, EnclosedBlock, float]] = []
    values: list[FloatArray] = []
    for number, family in enumerate(families):
        together = [
            enclosed_block(family, block, np.eye(block.size)) for block in family.blocks
        ]
        limit = _trace_limit(family, together)
        for entry, block, found in zip(
            together, family.blocks, family.evaluate(rotations), strict=True
        ):
            weight = block.tableaux / limit
            values.append(weight * found.reshape(points, -1))
            blocks.append((number, entry, weight * _value_error(family, entry, limit)))
    gram = sum((part @ part.T for part in values), np.zeros((points, points)))
    strengths, vectors = np.linalg.eigh(gram)
    strengths, vectors = strengths[-dimension:], vectors[:, -dimension:]
    if strengths[0] <= 1e-12 * strengths[-1]:
        raise NoBasisError("the blocks span less than the space of invariants")
    goal = sqrt(points) * vectors / strengths
    matrix = np.zeros((points, dimension))
    largest, error = np.zeros(len(families)), 0.0
    for part, (number, _, off) in zip(values, blocks, strict=True):
        combination = part.T @ goal  # T of this block times τ/d
        matrix += part @ combination
        largest[number] = max(largest[number], float(np.linalg.norm(combination, 2)))
        rounding = gamma(part.shape[1] + len(blocks) + 8)
        error += float(np.linalg.norm(combination)) * (off + rounding)
    left_inverse = np.asarray(np.linalg.pinv(matrix), dtype=float)
    norm = float(np.linalg.norm(left_inverse, 2))
    defect = float(np.linalg.norm(left_inverse @ matrix - np.eye(dimension)))
    rounding = gamma(points + 2) * float(np.linalg.norm(left_inverse) * np.linalg.norm(matrix))
    defect = SAFETY**2 * (defect + rounding + norm * sqrt(points) * error)
    if not defect < 0.5:
        raise NoBasisError(f"the values are too inexact: ‖RG − I‖ could be {defect:.2g}")
    return InvariantBasis(left_inverse, defect, SAFETY**2 * float(largest.sum()))


def _trace_limit(family: SectorBlocks, blocks: Sequence[EnclosedBlock]) -> float:
    """Return τ ≥ Σ_b d_b tr B_b(x) = Σ_b Σ_T |U_Tᵀφ|²/(2L+1) for all configurations.

    U_T of all blocks side by side is a multiple of an orthogonal matrix, nearly, for each set
    of labels. What couples a set of labels to its conjugate cancels between even and odd rows.
    """
    squares = [np.zeros((rows.length, rows.length)) for rows in family.rows]
    for block in blocks:
        for number, a in block.parts:
            flat = a.transpose(1, 0, 2).reshape(a.shape[1], -1)
            squares[number] += flat @ flat.T
    total = sum(
        float(np.abs(square).sum(axis=1).max()) * len(rows.assignments)
        for square, rows in zip(squares, family.rows, strict=True)
    )
    return SAFETY * total / (2 * family.sector.spin + 1)


def _value_error(family: SectorBlocks, block: EnclosedBlock, limit: float) -> float:
    """Return a bound on ‖computed B − averaged B‖ in the Frobenius norm."""
    wrong = product_error(family, block)
    # |w|² = Σ_T |U_Tᵀφ|² for one order is at most τ (2L+1); B sums wwᵀ over tableaux,
    # components and orders.
    squared = limit * (2 * family.sector.spin + 1)
    terms = 2 * block.scale + len(family.orders) + 8
    error = 2 * sqrt(squared) * wrong + wrong**2 + gamma(terms) * squared
    asymmetry = float(block.asymmetry(np.array(sqrt(squared))))
    return SAFETY * (error + asymmetry) / block.scale
