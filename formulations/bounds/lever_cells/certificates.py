"""Whether multipliers exclude all arms of the frames in a cell.

If there is an arm of a frame in a cell, the forms Y and X of `forms` have a sum at most 0. As
4θ ≤ |y|² + |q'|² ≤ 4 and 2θ ≤ 1 + |q'|² ≤ 2, their least eigenvalues there, y and x, have

    4 min(y, θ y) + 2 min(x, θ x) ≤ 0.

Squares τ_k² lie between 0 and 1: the negative part of each one's matrix is added to the
constant matrix, the positive part is left out. The rest is affine in each τ_k, least
eigenvalues are concave, and so is the sum above: it is least at a corner of the cube |τ_k| ≤ 1.
"""

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.corners import (
    MIXED,
    MONOMIALS,
    SQUARES,
    BoolArray,
    swap,
)
from lockedjoint.formulations.bounds.lever_cells.equations import Multipliers
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.forms import Forms
from lockedjoint.nlp.arrays import FloatArray

#: Cells whose corners are tested together: their matrices should stay in the cache.
_TOGETHER = 32
#: Least θ of a cell that can be excluded: then ‖K‖² < 0.42 and ‖Z‖ < 1, so that rounding is
#: small. It was at least 0.91.
LEAST_THETA = 0.5
#: What is taken off an eigenvalue, so that rounding does not make the matrix indefinite.
_ROUNDING = 1e-9


def values(expansion: Expansion, multipliers: Multipliers, limit: float) -> FloatArray:
    """Return lower bounds of the sum above, (N,), by all eigenvalues at all corners: slowly.

    They are −∞ where the bounds of a cell do not hold. The multipliers must be admissible.
    """
    forms = Forms.of(expansion, multipliers, limit)
    y = _least(forms.second_order_Y()) - forms.error_Y()[:, None]
    x = _least(forms.second_order_X()) - forms.error_X()[:, None]
    theta = expansion.rest.theta[:, None]
    found = (4 * np.minimum(y, theta * y) + 2 * np.minimum(x, theta * x)).min(1)
    return np.where(expansion.cells.ok & np.isfinite(found), found, -np.inf)


def _least(second_order: FloatArray) -> FloatArray:
    """Return the least eigenvalues at the corners, (N,64), of matrices (N,28,n,n)."""
    N, _, n, _ = second_order.shape
    at_corners = MONOMIALS.T @ without_squares(second_order).reshape(N, 22, n * n)
    return np.asarray(np.linalg.eigvalsh(at_corners.reshape(N, 64, n, n))[..., 0])


def without_squares(second_order: FloatArray) -> FloatArray:
    """Return lower bounds of matrices (N,28,n,n), without squares τ_k²: (N,22,n,n)."""
    roots, vectors = np.linalg.eigh(second_order[:, 7 + SQUARES])
    negative = (vectors * np.minimum(roots, 0.0)[:, :, None, :]) @ swap(vectors)
    constant = second_order[:, :1] + negative.sum(1, keepdims=True)
    return np.concatenate([constant, second_order[:, 1:7], second_order[:, 7 + MIXED]], 1)


def excluded(
    expansion: Expansion, multipliers: Multipliers, limit: float, margin: float
) -> tuple[BoolArray, Forms]:
    """Return whether multipliers prove that no arm of a frame in a cell is within a limit.

    Parameters
    ----------
    expansion
        The cells.
    multipliers
        Theirs. Those that are not admissible prove nothing.
    limit
        Greatest lever arm A of the arms.
    margin
        What the sum must exceed, because of rounding.

    Returns
    -------
    tuple
        For each cell whether it is excluded, and the forms of all cells. Where it is, `values`
        is above the margin; the middle is tested first.
    """
    admissible = multipliers.admissible()
    usable = Multipliers.unpacked(np.where(admissible[:, None], multipliers.packed(), 0.0))
    forms = Forms.of(expansion, usable, limit)
    error_Y, error_X = forms.error_Y(), forms.error_X()
    middle = 6 * np.minimum(forms.middle, expansion.rest.theta * forms.middle)
    with np.errstate(all="ignore"):
        above = middle - 4 * error_Y - 2 * error_X > margin
    above &= expansion.rest.theta > LEAST_THETA
    todo = np.flatnonzero(above & admissible & expansion.cells.ok)
    found = np.zeros(len(admissible), bool)
    for start in range(0, len(todo), _TOGETHER):
        some = todo[start : start + _TOGETHER]
        found[some] = _at_corners(forms.take(some), error_Y[some], error_X[some], margin)
    return found, forms


def _at_corners(
    forms: Forms, error_Y: FloatArray, error_X: FloatArray, margin: float
) -> BoolArray:
    """Whether the sum is above the margin at all corners, for the errors of Y and X, (N,).

    An eigenvalue x of X, less a little, is the least one if X − x is positive. The sum is
    above the margin if also Y is greater than what x leaves for it.
    """
    N, theta = len(error_Y), forms.expansion.rest.theta[:, None]
    X = _columns(without_squares(forms.second_order_X()))
    X_full = np.zeros((X.shape[1], 5, 5))
    row, column = np.triu_indices(5)
    X_full[:, column, row] = X.T
    # the lower part is all that eigvalsh reads
    x = np.linalg.eigvalsh(X_full)[:, 0] - _ROUNDING
    proved_x = x.reshape(N, 64) - error_X[:, None]
    y = (margin - 2 * np.minimum(proved_x, theta * proved_x)) / 4
    needed = np.where(y > 0, y / theta, y) + error_Y[:, None]
    Y = _columns(without_squares(forms.second_order_Y()))
    X[_diagonal(5)] -= x
    Y[_diagonal(10)] -= needed.reshape(-1)
    good = positive(X, 5) & positive(Y, 10)
    return np.asarray(good.reshape(N, 64).all(1))


def _columns(P: FloatArray) -> FloatArray:
    """Return the matrices of P (N,22,n,n) at all corners as `positive` has them, (·,64 N)."""
    N, _, n, _ = P.shape
    column, row = np.triu_indices(n)
    entries = P.reshape(N, 22, n * n)[:, :, row * n + column].transpose(2, 0, 1)
    return np.asarray((entries.reshape(-1, 22) @ MONOMIALS).reshape(len(row), -1))


def _diagonal(n: int) -> list[int]:
    """Return the places of the diagonal among the lower columns of an n×n matrix."""
    return [int(place) for place in np.cumsum([0, *range(n, 1, -1)])]


def positive(A: FloatArray, n: int) -> BoolArray:
    """Return whether symmetric n×n matrices are positive definite, by their pivots.

    Parameters
    ----------
    A
        M matrices, (n(n+1)/2, M): the lower columns, one after another. Overwritten.
    n
        Their number of rows.
    """
    good = np.ones(A.shape[1], bool)
    start = 0
    with np.errstate(all="ignore"):
        for j in range(n):
            pivot, column = A[start], A[start + 1 : start + n - j]
            good &= pivot > 0
            share = column / pivot
            start += n - j
            at = start
            for i in range(len(column)):
                A[at : at + len(column) - i] -= share[i] * column[i:]
                at += len(column) - i
    return good
