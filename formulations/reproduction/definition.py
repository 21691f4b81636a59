"""Section 2: the bound on the worst case, and what each joint contributes, eqs. (6)–(11)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown, shown_error
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray

SHAPES = ((2, 3), (2, 4), (3, 4), (3, 7), (6, 7), (6, 8), (6, 12))
_PER_SHAPE = 100
_ROUNDING = 1e-12


def rows(seed: int = 0) -> Iterator[Row]:
    """Rows of Section 2, on random Jacobians of several shapes."""
    rng = np.random.default_rng(seed)
    general = [rng.standard_normal(shape) for shape in SHAPES for _ in range(_PER_SHAPE)]
    isotropic = [_orthonormal_rows(matrix) for matrix in general]
    count = f"{len(general)} random Jacobians, m from 2 to 6, n from 3 to 12"
    yield _bound_row("isotropic J", isotropic, count)
    yield _bound_row("any J, with σ² = tr JJᵀ/m", general, count + "; beyond the paper")
    yield _attained_row()
    yield _equal_norms_row(isotropic)
    yield from _contribution_rows(general)


def _bound_row(which: str, matrices: list[FloatArray], note: str) -> Row:
    largest = max(_share_of_bound(matrix) for matrix in matrices)
    quantity = f"largest worst case over its bound, {which}"
    verdict = holds(largest <= 1 + _ROUNDING)
    return Row("(6)", quantity, "at most 1", shown(largest), verdict, note)


def _attained_row() -> Row:
    shares = [_share_of_bound(reference.harmonic_jacobian(m, n)) for m, n in SHAPES]
    note = "harmonic frames: isotropic with columns of equal norm, one of each shape"
    verdict = equal(1, shares, _ROUNDING)
    farthest = max(shares, key=lambda share: abs(share - 1))
    quantity = "worst case over its bound, optimally failure-tolerant J"
    return Row("(6)", quantity, "1", shown(farthest), verdict, note)


def _equal_norms_row(matrices: list[FloatArray]) -> Row:
    errors = [
        np.max(
            np.abs(
                measures.locked_singular_values(matrix) ** 2
                - np.maximum(1 - np.sum(matrix**2, axis=0), 0)
            )
        )
        for matrix in matrices
    ]
    error = float(max(errors))
    return Row(
        "Sec. 2",
        "equality in (6) for all f is the same as columns of equal norm",
        "equivalent",
        f"fσ_m² = σ² − ‖j_f‖² {shown_error(error, _ROUNDING)}",
        holds(error <= _ROUNDING),
        "random isotropic J with σ = 1; the squares ‖j_f‖² add up to mσ²",
    )


def _contribution_rows(matrices: list[FloatArray]) -> Iterator[Row]:
    """R_i and N_i from the two parts of V, apart from the functions of `measures`."""
    parts = [(matrix, *_partition(matrix)) for matrix in matrices]
    apart = [np.abs(top - measures.range_contributions(matrix)) for matrix, top, _ in parts]
    error = float(max(np.max(difference) for difference in apart))
    yield Row(
        "(7)–(9)",
        "R_i from the upper m rows of Vᵀ",
        "‖j_i‖² of the orthonormal rows",
        shown_error(error, _ROUNDING),
        holds(error <= _ROUNDING),
        "Vᵀ partitioned after row m, against the measure computed from J",
    )
    sums = np.concatenate([top + bottom for _, top, bottom in parts])
    farthest = float(sums[np.argmax(np.abs(sums - 1))])
    note = "R_i from the upper, N_i from the lower rows of Vᵀ, the one farthest from 1"
    verdict = equal(1, sums, _ROUNDING)
    yield Row("(10)–(11)", "R_i + N_i", "1", shown(farthest), verdict, note)


def _share_of_bound(matrix: FloatArray) -> float:
    m, n = matrix.shape
    bound = measures.sigma_bound(m, n, measures.trace(matrix))
    return measures.worst_case_sigma(matrix) / bound


def _orthonormal_rows(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.qr(matrix.T)[0].T)


def _partition(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    m = matrix.shape[0]
    squares = np.linalg.svd(matrix)[2] ** 2
    return np.sum(squares[:m], axis=0), np.sum(squares[m:], axis=0)
