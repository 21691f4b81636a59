"""The space of invariants: its dimension, and a basis that bounds an invariant by few values.

The space V is that of the functions on SO(3)ⁿ which are polynomials of degree at most d in the
entries of J and do not change under rotations of the frame, a common phase, conjugation, or
signs and order of the columns. Its dimension D is the average of the trace over these groups,
counted exactly: only integers and fractions occur.

Let e_1 … e_D be combinations of averaged block entries, e_j = Σ_b ⟨T_jb, B_b⟩, which lie in V.
If their values at points x_1 … x_P, known up to small errors, have a left inverse R, they are a
basis, and f ∈ V with values f_i there is Σ c_j e_j with |c| ≤ |R f|/(1 − q), where q bounds
‖RG − I‖ for the exact matrix G of values. For the blocks of one sector Σ_b d_b tr B_b(x) ≤ τ,
where d_b is the number of tableaux, and B_b ⪰ 0. So

    |f(x)| ≤ |c| Σ_sectors τ max_b ‖T_b‖/d_b   for every configuration x.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial, prod, sqrt
from typing import TypeAlias

import numpy as np

from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    SAFETY,
    EnclosedBlock,
    enclosed_block,
    product_error,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.representations.rounding import gamma
from formulations.bounds.so3_moments.representations.row_sectors import label_degree
from formulations.existence.relaxation.tableaux import partitions
from nlp.arrays import FloatArray, whole_number
from nlp.errors import LockedJointError

# Coefficients by (degree, weight of the frame rotation, phase charge).
Character: TypeAlias = Mapping[tuple[int, int, int], int]


def invariant_dimension(joints: int, degree: int) -> int:
    """Return the dimension of the space of invariants of degree at most `degree`.

    Raises
    ------
    InputError
        Unless both are positive integers.
    """
    whole_number("joints", joints, 1)
    whole_number("degree", degree, 1)
    total = Fraction(0)
    for conjugated in (False, True):
        cycles = {length: _cycle(length, degree, conjugated) for length in range(1, joints + 1)}
        known: dict[tuple[int, ...], Character] = {(): {(0, 0, 0): 1}}
        for lengths in partitions(joints):
            for end, length in enumerate(lengths):
                if lengths[: end + 1] not in known:
                    product = _product(known[lengths[:end]], cycles[length], degree)
                    known[lengths[: end + 1]] = product
            share = Fraction(1, _centraliser(lengths))
            total += share * _trivial_part(known[lengths]) / 2
    if total.denominator != 1:
        raise ArithmeticError("a dimension must be an integer")
    return int(total)


def _cycle(length: int, degree: int, conjugated: bool) -> Character:
    """Return the trace of a cycle of joints on products that are even in every joint.

    It is the trace of the `length`-th power of what acts on one joint. Conjugation takes m to
    −m with the sign (−1)^l, and its square is 1.
    """
    found: Counter[tuple[int, int, int]] = Counter()
    for spin in range(degree + 1):
        for m in range(-spin, spin + 1):
            size = length * label_degree((spin, m))
            if m % 2 or size > degree or (conjugated and length % 2 and m):
                continue
            value = (-1) ** spin if conjugated and length % 2 else 1
            for weight in range(-spin, spin + 1):
                found[size, length * weight, 0 if conjugated else length * m] += value
    return found


def _product(first: Character, second: Character, degree: int) -> Character:
    found: Counter[tuple[int, int, int]] = Counter()
    for (a, weight, charge), value in first.items():
        for (b, other_weight, other_charge), other in second.items():
            if a + b <= degree:
                found[a + b, weight + other_weight, charge + other_charge] += value * other
    return found


def _trivial_part(character: Character) -> int:
    """Return how often total spin 0 and charge 0 occur: weight 0 less weight 1."""
    return sum(
        value * ((weight == 0) - (weight == 1))
        for (_, weight, charge), value in character.items()
        if charge == 0
    )


def _centraliser(lengths: tuple[int, ...]) -> int:
    """Return n! over the number of permutations with these cycles."""
    return prod(length**n * factorial(n) for length, n in Counter(lengths).items())


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
