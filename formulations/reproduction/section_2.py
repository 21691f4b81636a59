"""Section 2: the bound on the worst case, and what each joint contributes, eqs. (6)–(11)."""

from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.reproduction import reference, row
from nlp.arrays import FloatArray

_SHAPES = ((2, 3), (2, 4), (3, 4), (3, 7), (6, 7), (6, 8), (6, 12))
_PER_SHAPE = 100


def rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Rows of Section 2, on random Jacobians of several shapes."""
    rng = np.random.default_rng(seed)
    general = [rng.standard_normal(shape) for shape in _SHAPES for _ in range(_PER_SHAPE)]
    isotropic = [np.asarray(np.linalg.qr(matrix.T)[0].T) for matrix in general]
    count = f"{len(general)} random Jacobians, m from 2 to 6, n from 3 to 12"
    for which, matrices, note in (
        ("isotropic J", isotropic, count),
        ("any J, with σ² = tr JJᵀ/m", general, f"{count}; beyond the paper"),
    ):
        largest = max(map(_share_of_bound, matrices))
        quantity = f"largest worst case over its bound, {which}"
        true = largest <= 1 + row.ROUNDING
        yield row.claim("(6)", quantity, "at most 1", row.shown(largest), true, note)
    shares = [_share_of_bound(reference.harmonic_jacobian(m, n)) for m, n in _SHAPES]
    quantity = "worst case over its bound, optimally failure-tolerant J"
    note = "harmonic frames: isotropic with columns of equal norm, one of each shape"
    yield row.compared("(6)", quantity, "1", 1, shares, note, show=row.farthest(1))
    squares = np.concatenate([measures.locked_singular_values(j) ** 2 for j in isotropic])
    rest = np.concatenate([np.maximum(1 - np.sum(j**2, axis=0), 0) for j in isotropic])
    error = float(np.max(np.abs(squares - rest)))
    quantity = "equality in (6) for all f is the same as columns of equal norm"
    ours = f"fσ_m² = σ² − ‖j_f‖² {row.shown_error(error)}"
    note = "random isotropic J with σ = 1; the squares ‖j_f‖² add up to mσ²"
    yield row.claim("Sec. 2", quantity, "equivalent", ours, error <= row.ROUNDING, note)
    # R_i and N_i from the two parts of V, without the functions of `measures`.
    parts = [np.split(np.linalg.svd(j)[2] ** 2, [len(j)]) for j in general]
    tops = np.concatenate([np.sum(top, axis=0) for top, _ in parts])
    bottoms = np.concatenate([np.sum(bottom, axis=0) for _, bottom in parts])
    known = np.concatenate([measures.range_contributions(j) for j in general])
    quantity, paper = "R_i from the upper m rows of Vᵀ", "‖j_i‖² of the orthonormal rows"
    note = "Vᵀ partitioned after row m, against the measure computed from J"
    yield row.within("(7)–(9)", quantity, paper, float(np.max(np.abs(tops - known))), note)
    sums, show = tops + bottoms, row.farthest(1)
    note = "R_i from the upper, N_i from the lower rows of Vᵀ, the one farthest from 1"
    yield row.compared("(10)–(11)", "R_i + N_i", "1", 1, sums, note, show=show)


def _share_of_bound(matrix: FloatArray) -> float:
    m, n = matrix.shape
    bound = measures.sigma_bound(m, n, measures.trace(matrix))
    return measures.worst_case_sigma(matrix) / bound
