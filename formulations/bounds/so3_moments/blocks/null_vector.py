"""Localisers of a worst case where the signs of the columns are fixed by the null vector.

J has one joint more than rows. Let n be its unit null vector, and choose the signs of the
columns such that every n_f ≥ 0. If J_fᵀJ_f ⪰ tI for every joint f, then 2n_f² ≥ t(1 − n_f²):
n_f j_f = −Σ n_g j_g over the others. So n_f² ≥ ν = t/(2 + t), the sum of the n_f is at least
6√ν + √(1 − 6ν), and the distance of the vector (1, …, 1) from the multiples of n at most √δ₀,

    δ₀ = 7 − (6√ν + √(1 − 6ν))².

Hence s = Σ j_f = J(1, …, 1) has sᵀM⁻¹s ≤ δ₀, that is δ₀M ⪰ ssᵀ, and |s|² ≤ δ₀ λ_max(M).

The blocks here are forms wᵀHw on vectors w = Σ r_a w_a with polynomials r_a, averaged over the
symmetries that are left: signs of columns are not among them, only the sign of all together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.blocks.sampled_blocks import RowBlocks
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.row_sectors import (
    UnsignedSector,
    label_degree,
)
from formulations.bounds.so3_moments.representations.wigner import jacobians_of, wigner_matrices
from nlp.arrays import FloatArray

JOINTS = 7
#: Units of s: between its size at a random configuration, √14, and √δ₀.
_UNIT = 0.6


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case is t or more."""
    share = t / (2 + t)
    total = 6 * sqrt(share) + sqrt(1 - 6 * share)
    return 7 - total**2 + 1e-12


def signs_by_null_vector(rotations: FloatArray) -> FloatArray:
    """Return rotations (configurations, 7, 3, 3) with columns (v; ω) turned to n_f ≥ 0."""
    null = np.linalg.svd(jacobians_of(rotations))[2][:, -1, :]
    turned = rotations.copy()
    turned[..., :2] *= np.where(null < 0, -1.0, 1.0)[..., None, None]
    return turned


@dataclass(frozen=True)
class Form:
    """A form H on vectors w_a that is positive semidefinite where the conditions hold.

    Parameters
    ----------
    values
        Values w_aᵀHw_b, (configurations, vectors, vectors), at Jacobians (configurations, 6, 7)
        with the given joint locked.
    lowered
        Degree of each w_a in the entries of J, less that of the first.
    """

    values: Callable[[FloatArray, int], FloatArray]
    lowered: tuple[int, ...]


def gram_form(t: float) -> Form:
    """Return J_fᵀJ_f − tI on the vectors (1, …, 1), J_fᵀj_f and J_fᵀs."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        kept, column, total = _parts(jacobians, locked)
        ones = np.full((len(jacobians), JOINTS - 1, 1), 1 / sqrt(6))
        vectors = np.concatenate([ones, kept.swapaxes(1, 2) @ _units(column, total)], axis=2)
        return _products(kept @ vectors) - t * _products(vectors)

    return Form(values, (0, 2, 2))


def krylov_form(t: float) -> Form:
    """Return J_f J_fᵀ − tI on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        kept, column, total = _parts(jacobians, locked)
        vectors = _krylov(jacobians, _units(column, total))
        return _products(kept.swapaxes(1, 2) @ vectors) - t * _products(vectors)

    return Form(values, (0, 0, 2, 2))


def deviation_form(deviation: float) -> Form:
    """Return M − ssᵀ/δ₀, in units of s, on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        _, column, total = _parts(jacobians, locked)
        vectors = _krylov(jacobians, _units(column, total))
        along = total.swapaxes(1, 2) @ vectors / _UNIT
        return deviation / _UNIT**2 * _products(jacobians.swapaxes(1, 2) @ vectors) - _products(
            along
        )

    return Form(values, (0, 0, 2, 2))


class FormLocaliser(RowBlocks):
    """Blocks of a form on vectors, averaged over symmetries and locked joints.

    Parameters
    ----------
    sector
        The polynomials, with a locked joint; the degree of r_a is lower by `form.lowered`.
    form
        The form.
    """

    def __init__(self, sector: UnsignedSector, form: Form) -> None:
        super().__init__(sector, JOINTS)
        self.form = form
        self.selections = [self._selection(block) for block in self.blocks]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [len(chosen) for chosen, _ in self.selections]

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, 7, 3, 3)."""
        wigner = wigner_matrices(rotations, self.largest_spin)
        jacobians = jacobians_of(rotations)
        total = [np.zeros((len(rotations), size, size)) for size in self.sizes]
        for locked in range(JOINTS):
            values = self.form.values(jacobians, locked)
            order = [locked, *(joint for joint in range(JOINTS) if joint != locked)]
            squares = self.mean_squares(wigner, [order], share=JOINTS)
            for block, square, (chosen, vectors) in zip(
                total, squares, self.selections, strict=True
            ):
                weights = values[:, vectors[:, None], vectors]
                block += square[:, chosen[:, None], chosen] * weights
        return total

    def _selection(self, block: AdaptedRows) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which scalar row, and which vector, makes each row of a block."""
        degrees = np.zeros(block.size, dtype=int)
        for number, columns, _ in block.parts:
            degree = sum(map(label_degree, self.rows[number].labels))
            degrees[columns.start : columns.stop] = degree
        allowed = [
            np.flatnonzero(degrees <= self.sector.degree - less) for less in self.form.lowered
        ]
        vectors = [np.full(len(chosen), a) for a, chosen in enumerate(allowed)]
        return np.concatenate(allowed), np.concatenate(vectors)


def _parts(jacobians: FloatArray, locked: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return J_f, j_f and s; vectors have shape (configurations, 6, 1)."""
    kept = np.delete(jacobians, locked, axis=2)
    total = jacobians.sum(axis=2, keepdims=True)
    return kept, jacobians[:, :, locked, None], total


def _units(column: FloatArray, total: FloatArray) -> FloatArray:
    return np.concatenate([column / sqrt(2), total / _UNIT], axis=2)


def _krylov(jacobians: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the vectors, and M times them in units of n/3."""
    image = jacobians @ (jacobians.swapaxes(1, 2) @ vectors) / (JOINTS / 3)
    return np.concatenate([vectors, image], axis=2)


def _products(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors.swapaxes(1, 2) @ vectors)
