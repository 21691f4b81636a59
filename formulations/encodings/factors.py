"""Eigenvalue constraints after column deletions, as smooth constraints.

Given an m×n matrix A of expressions, a level t and a family of column sets F, say

    λ_min(A Aᵀ − A_F A_Fᵀ) ≥ t     for every F in the family                      (*)

without ever differentiating an eigenvalue, which has no derivative where eigenvalues repeat.
A_F has the columns in F, A_F̄ all others: A Aᵀ − A_F A_Fᵀ = A_F̄ A_F̄ᵀ. A factor of a matrix is
a lower triangular L with L Lᵀ equal to it.

Each encoding is a function of A (`matrix`), t (`level`, an expression), the sets F (`deleted`,
columns counted from 0), and the least ``pivot`` that any diagonal entry of a factor of
A Aᵀ − tI may be held above. All introduce auxiliary variables, which the encoding's
`complete_start` computes from a numeric A. ``X ⪯ Y`` means that Y − X is positive semidefinite.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Constraint

# Least eigenvalue of the matrix whose factor is a start, in percent of its largest one in
# absolute value. At 0 the factor would be singular. It is 0.1 and an error of rounding, so that
# starts that are on record stay the same bit for bit.
_LEAST_PERCENT = 1.0 - 0.9
# The same eigenvalue is at least this. Entries of A are of the order of 1.
_LEAST_EIGENVALUE = 1e-4
#: The factor of JJᵀ − tI stays this share of √t away from a singular one, which the optimum may
#: have: what is lost of t is the square.
NEARLY_SINGULAR = 1e-4


@dataclass(frozen=True, eq=False)
class Encoding:
    """The constraints (*) in smooth form, on A, t and auxiliary variables."""

    variables: ca.SX  # auxiliary symbols, a column
    lower: FloatArray  # their lower bounds; they have no upper ones
    constraints: tuple[Constraint, ...]
    # Auxiliary values to start from, for a numeric A and t.
    complete_start: Callable[[FloatArray, float], FloatArray]


#: An encoding: a function of `matrix`, `level`, `deleted` and `pivot`, see above.
Encode: TypeAlias = Callable[[ca.SX, ca.SX, Sequence[tuple[int, ...]], float], Encoding]


def _shared_factor(
    matrix: ca.SX, level: ca.SX, deleted: Sequence[tuple[int, ...]], pivot: float
) -> Encoding:
    """Encode (*) by one triangular factor that all deletions share.

    With L Lᵀ = A Aᵀ − tI, diag L ≥ pivot > 0 and X = L⁻¹A, Schur complements turn (*) into
    X_Fᵀ X_F ⪯ I. For one column that is ‖x_f‖² ≤ 1: a single smooth row per deletion, the
    forward substitution carried out symbolically. For more columns I − X_Fᵀ X_F gets a
    small factor of its own.
    """
    m = matrix.shape[0]
    entries, factor = triangular("L", m)
    whitened = _forward_substitution(factor, matrix)
    singles = [columns[0] for columns in deleted if len(columns) == 1]
    several = [columns for columns in deleted if len(columns) > 1]
    # A factor of I − X_Fᵀ X_F for each set of several columns.
    small = [triangular(f"C{k}", len(columns)) for k, columns in enumerate(several)]

    constraints = [factor_of("shared factor", _shifted(matrix, level), factor)]
    if singles:
        lengths = ca.vertcat(*(ca.sumsqr(whitened[:, f]) for f in singles))
        constraints.append(Constraint("deleted column", lengths, -np.inf, 1.0))
    for columns, (_, root) in zip(several, small, strict=True):
        part = whitened[:, list(columns)]
        gap = ca.SX.eye(len(columns)) - part.T @ part
        constraints.append(factor_of(_name(columns), gap, root))

    def complete_start(numeric: FloatArray, t: float) -> FloatArray:
        """Return the entries of L, and of the factors of I − X_Fᵀ X_F, at a numeric A."""
        root = _factor(numeric @ numeric.T - t * np.eye(m))
        x = np.linalg.solve(root, numeric)
        parts = [x[:, list(columns)] for columns in several]
        gaps = [_factor(np.eye(part.shape[1]) - part.T @ part) for part in parts]
        return np.concatenate([_packed(root), *(_packed(gap) for gap in gaps)])

    diagonals = [_diagonal_bounds(m, pivot), *(_diagonal_bounds(len(c), 0.0) for c in several)]
    variables = ca.vertcat(entries, *(symbols for symbols, _ in small))
    return Encoding(variables, np.concatenate(diagonals), tuple(constraints), complete_start)


def _principal_minors(
    matrix: ca.SX, level: ca.SX, deleted: Sequence[tuple[int, ...]], pivot: float
) -> Encoding:
    """Encode (*) as `_shared_factor` does, I − X_Fᵀ X_F ⪰ 0 by its principal minors.

    Rows det(I − X_Gᵀ X_G) ≥ 0 for each column and each leading part G of each F, and no
    auxiliary variables but the shared factor. For one column the same as `_shared_factor`. For
    several it is cheaper where the deletions leave columns to spare (four times on six rows),
    and loses most starts where they leave a square matrix of six rows.
    """
    m, n = matrix.shape
    shared = _shared_factor(matrix, level, (), pivot)
    whitened = _forward_substitution(_lower(m, shared.variables), matrix)
    left = ca.SX.eye(n) - whitened.T @ whitened
    rows = Constraint("principal minors", leading_minors(left, deleted), 0.0, np.inf)
    return replace(shared, constraints=(*shared.constraints, rows))


def leading_minors(matrix: ca.SX, sets: Sequence[tuple[int, ...]]) -> ca.SX:
    """Return a column of the principal minors of each index, and each leading part of a set."""
    parts = {chosen[:size] for chosen in sets for size in range(1, len(chosen) + 1)}
    parts |= {(index,) for chosen in sets for index in chosen}
    return ca.vertcat(*(ca.det(matrix[list(part), list(part)]) for part in sorted(parts)))


def _factor_per_deletion(
    matrix: ca.SX,
    level: ca.SX,
    deleted: Sequence[tuple[int, ...]],
    pivot: float,  # noqa: ARG001
    least: float = -np.inf,
) -> Encoding:
    """Encode (*) by one triangular factor per deletion: L_F L_Fᵀ = A_F̄ A_F̄ᵀ − tI.

    The classical lifting, with diag L_F ≥ `least`. At the optimum every binding factor is
    singular, and its diagonal may pass through zero on the way where it is free: many starts
    stall there. Kept for comparison.
    """
    m, n = matrix.shape
    factors = [triangular("L" + "_".join(map(str, columns)), m) for columns in deleted]
    constraints = []
    for columns, (_, factor) in zip(deleted, factors, strict=True):
        kept = matrix[:, [i for i in range(n) if i not in columns]]
        constraints.append(factor_of(_name(columns), _shifted(kept, level), factor))

    def complete_start(numeric: FloatArray, t: float) -> FloatArray:
        """Return the entries of all L_F at a numeric A."""
        kept = [np.delete(numeric, columns, axis=1) for columns in deleted]
        return np.concatenate([factor_start(k @ k.T - t * np.eye(m)) for k in kept])

    variables = ca.vertcat(*(symbols for symbols, _ in factors))
    lower = np.tile(_diagonal_bounds(m, least), len(deleted))
    return Encoding(variables, lower, tuple(constraints), complete_start)


#: The encodings with auxiliary factors, by name.
ENCODINGS: Mapping[str, Encode] = {
    "shared-factor": _shared_factor,
    "principal-minors": _principal_minors,
    "factor-per-deletion": _factor_per_deletion,
    "positive-factor-per-deletion": partial(_factor_per_deletion, least=0.0),
}


def least_pivot(
    shape: tuple[int, int], weight: float, sets: Sequence[tuple[int, ...]], floor: float
) -> float:
    """Return what every diagonal entry of a factor of JJᵀ − w²tI may be held above.

    J has the given shape (m, n), w is the `weight` of the `sets`, and t ≥ `floor`. No diagonal
    entry of a factor is below the square root of the matrix's least eigenvalue. If w < 1, JJᵀ ⪰
    tI for the likeliest failures' sake leaves (1 − w²)t; if every joint is in a set of weight
    1, λ_min(JJᵀ − tI) ≥ t/(n − m), see `measures.sigma_bound`; else JJᵀ − tI may be singular.
    """
    m, n = shape
    nearly = NEARLY_SINGULAR * np.sqrt(floor)
    if weight < 1:
        return float(max(np.sqrt((1 - weight**2) * floor), nearly))
    everywhere = {f for joints in sets for f in joints} == set(range(n))
    return float(np.sqrt(floor / (n - m)) if everywhere else nearly)


def triangular(name: str, size: int) -> tuple[ca.SX, ca.SX]:
    """Return symbols, a column, and the lower triangular matrix that they fill row by row."""
    symbols = ca.SX.sym(name, size * (size + 1) // 2)
    return symbols, _lower(size, symbols)


def _lower(size: int, entries: ca.SX) -> ca.SX:
    """Return the lower triangular matrix with these entries row by row.

    CasADi fills a matrix column by column: the upper one, transposed, is the lower one row by
    row.
    """
    return ca.SX(ca.Sparsity.upper(size), entries).T


def _shifted(matrix: ca.SX, level: ca.SX) -> ca.SX:
    """Return A Aᵀ − tI."""
    return matrix @ matrix.T - level * ca.SX.eye(matrix.shape[0])


def factor_of(name: str, gram: ca.SX, factor: ca.SX) -> Constraint:
    """State that a symmetric matrix is L Lᵀ, by its lower part, row by row."""
    gap = ca.densify(gram - factor @ factor.T)
    return Constraint(name, ca.triu(gap.T).nz[:], 0.0, 0.0)


def _name(columns: tuple[int, ...]) -> str:
    """Return the name of the constraint on these deleted columns."""
    return "deleted columns " + ",".join(map(str, columns))


def _packed(factor: FloatArray) -> FloatArray:
    """Return the lower part of a matrix, row by row, as `triangular` has its symbols."""
    return factor[np.tril_indices(len(factor))]


def factor_start(matrix: FloatArray) -> FloatArray:
    """Return the entries of a factor, row by row, of a positive definite matrix nearby."""
    return _packed(_factor(matrix))


def _diagonal_bounds(size: int, least: float) -> FloatArray:
    """Return lower bounds on the entries of a factor: `least` on the diagonal, −∞ elsewhere."""
    return _packed(np.where(np.eye(size), least, -np.inf))


def _forward_substitution(factor: ca.SX, matrix: ca.SX) -> ca.SX:
    """Return L⁻¹A, L lower triangular, as expressions."""
    rows: list[ca.SX] = []
    for i in range(factor.shape[0]):
        known = sum((factor[i, j] * rows[j] for j in range(i)), ca.SX.zeros(1, matrix.shape[1]))
        rows.append((matrix[i, :] - known) / factor[i, i])
    return ca.vertcat(*rows)


def _factor(matrix: FloatArray) -> FloatArray:
    """Return the Cholesky factor of a symmetric matrix, small eigenvalues raised before."""
    values, vectors = np.linalg.eigh(matrix)
    least = max(_LEAST_EIGENVALUE, _LEAST_PERCENT * float(np.max(np.abs(values))) * 1e-2)
    return np.linalg.cholesky((vectors * np.maximum(values, least)) @ vectors.T)
