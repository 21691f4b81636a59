"""The semidefinite programs whose duals are the multipliers of cells.

The program of a cell asks for moments of an arm of the frame in its middle: a matrix Y of
(y, q), 10×10, a vector q and the greatest s with

    Y − s ≥ 0,  X = [1 qᵀ; q Q] − s ≥ 0,  every inequality of `equations` ≥ s,  |r|² < SPREAD²,

where Q is the block of q in Y and n = Fᵀq, nnᵀ = FᵀQF. The residual r of the 37 equations is
weighted by the inverse Cholesky factor of Σ (changes of the equations in the cell)², so that
multipliers cost as much as the form changes to first order. If s < 0, no arm fulfils the
equations in the middle.

Unknowns x: the 55 entries of Y above and on the diagonal, those above times √2; the 4 of q; s.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.corners import swap
from lockedjoint.formulations.bounds.lever_cells.equations import (
    EQUATIONS,
    PAIR_I,
    PAIR_J,
    RIGHT,
    Multipliers,
    ends,
)
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.nlp.arrays import FloatArray

#: Weight of the first-order change of the form in a cell.
SPREAD = 3.0
#: What is added to the squares of these changes.
_RIDGE = 1e-4
#: What s is below the least eigenvalue or inequality at the start.
_START = 0.3
#: Number of unknowns.
UNKNOWNS = 60
#: Number of those in Y; q follows.
IN_Y = 55
#: Place of s among the unknowns.
S = 59
#: Rows of the places on and above the diagonal of a 10×10 matrix, 55.
ROW = np.triu_indices(10)[0]
#: Columns of these places.
COLUMN = np.triu_indices(10)[1]
#: Factors of these entries in x.
SCALE: FloatArray = np.where(ROW == COLUMN, 1.0, np.sqrt(2.0))
#: Place of each entry of Y in x.
PLACE = np.zeros((10, 10), int)
PLACE[ROW, COLUMN] = PLACE[COLUMN, ROW] = np.arange(IN_Y)
#: Unknowns that X and the inequalities depend on: Q, 10, q, 4, and s.
SHARED = np.concatenate([PLACE[6:, 6:][np.triu_indices(4)], np.arange(IN_Y, UNKNOWNS)])


def _changes_of_X() -> FloatArray:
    """Return the derivative of X in each of the shared unknowns, 15×5×5."""
    changes = np.zeros((15, 5, 5))
    for number, (i, j) in enumerate(combinations_with_replacement(range(4), 2)):
        entry = 1.0 if i == j else np.sqrt(0.5)
        changes[number, i + 1, j + 1] = changes[number, j + 1, i + 1] = entry
    for i in range(4):
        changes[10 + i, 0, i + 1] = changes[10 + i, i + 1, 0] = 1.0
    changes[14] = -np.eye(5)
    return changes


#: The derivative of X in each of the shared unknowns, 15×5×5.
X_CHANGES = _changes_of_X()


def matrices_Y(x: FloatArray) -> FloatArray:
    """Return Y − s of points, or the change of it along steps: (N,60) to (N,10,10)."""
    return np.asarray((x[:, :IN_Y] / SCALE)[:, PLACE] - x[:, S, None, None] * np.eye(10))


def matrices_X(x: FloatArray) -> FloatArray:
    """Return the change of X along steps: (N,60) to (N,5,5)."""
    return np.asarray((x[:, SHARED] @ X_CHANGES.reshape(15, 25)).reshape(-1, 5, 5))


@dataclass(frozen=True)
class Point(Cases):
    """What must be positive at a point of each program.

    Attributes
    ----------
    Y, X
        Y − s, (N,10,10), and X, (N,5,5).
    inequalities
        Products, `lower` and `upper` of `Multipliers`, less s, (N,35).
    residual
        The weighted residual r of the equations, (N,37).
    ball
        SPREAD² − |r|², (N,).
    """

    Y: FloatArray
    X: FloatArray
    inequalities: FloatArray
    residual: FloatArray
    ball: FloatArray


@dataclass(frozen=True)
class Programs(Cases):
    """The programs of N cells.

    Attributes
    ----------
    F
        The second parts of the frames, (N,4,7).
    unweighted
        The equations in the middle as functions of Y, (N,37,55).
    weights
        The inverse Cholesky factor: r = weights (b − unweighted Y), (N,37,37).
    equations, right
        Their products with the equations and b, (N,37,55) and (N,37).
    squares
        equationsᵀ equations, (N,55,55).
    at_zero, slopes
        The inequalities are at_zero + slopes x, x the shared unknowns, (N,35) and (N,35,15).
    """

    F: FloatArray
    unweighted: FloatArray
    weights: FloatArray
    equations: FloatArray
    right: FloatArray
    squares: FloatArray
    at_zero: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, expansion: Expansion, limit: float) -> "Programs":
        """Return the programs of cells, for arms with no lever arm above a limit."""
        F = expansion.cells.F
        unweighted, changes = _equations(expansion)
        spread = changes @ swap(changes) + _RIDGE * np.eye(37)
        weights = np.linalg.inv(np.linalg.cholesky(spread))
        equations = weights @ unweighted
        at_zero, slopes = _inequalities(F, limit)
        return cls(
            F=F,
            unweighted=unweighted,
            weights=weights,
            equations=equations,
            right=weights @ RIGHT,
            squares=swap(equations) @ equations,
            at_zero=at_zero,
            slopes=slopes,
        )

    def at(self, x: FloatArray) -> Point:
        """Return what must be positive at x, (N,60)."""
        X = matrices_X(x)
        X[:, 0, 0] += 1
        inequalities = self.at_zero + (self.slopes @ x[:, SHARED, None])[:, :, 0]
        residual = self.right - (self.equations @ x[:, :IN_Y, None])[:, :, 0]
        ball = SPREAD**2 - (residual * residual).sum(1)
        return Point(matrices_Y(x), X, inequalities, residual, ball)

    def start(self) -> FloatArray:
        """Return points with the least Y that fulfils the equations and a small enough s."""
        N, E = len(self.F), self.unweighted
        x = np.zeros((N, UNKNOWNS))
        right = np.broadcast_to(RIGHT[:, None], (N, 37, 1))
        x[:, :IN_Y] = (swap(E) @ np.linalg.solve(E @ swap(E) + 1e-9 * np.eye(37), right))[
            ..., 0
        ]
        x[:, IN_Y:S] = 0.9 * self.F.sum(2) / np.sqrt(7)
        point = self.at(x)
        least = np.minimum(np.linalg.eigvalsh(point.Y)[:, 0], np.linalg.eigvalsh(point.X)[:, 0])
        x[:, S] = np.minimum(least, point.inequalities.min(1)) - _START
        return x

    def dual(self, x: FloatArray, weight: FloatArray) -> Multipliers:
        """Return the multipliers of points on the central paths, for weights of s (N,)."""
        point = self.at(x)
        towards = -2 * (swap(self.weights) @ point.residual[:, :, None])[:, :, 0]
        equations = towards / (point.ball * weight)[:, None]
        of_inequalities = 1 / (weight[:, None] * point.inequalities)
        products, lower, upper = np.split(of_inequalities, [21, 28], axis=1)
        of_X = np.linalg.pinv(point.X, hermitian=True) / weight[:, None, None]
        phi = np.zeros((len(x), 7, 7))
        phi[:, PAIR_I, PAIR_J] = phi[:, PAIR_J, PAIR_I] = products / 2
        phi[:, np.arange(7), np.arange(7)] = -upper
        block = (equations @ EQUATIONS[:, 12:, 12:].reshape(37, 16)).reshape(-1, 4, 4)
        shared = block - self.F @ phi @ swap(self.F) - of_X[:, 1:, 1:]
        return Multipliers(equations, shared, products, lower, upper, of_X[:, 0, 0])


def _equations(expansion: Expansion) -> tuple[FloatArray, FloatArray]:
    """Return the equations in the middle, (N,37,55), and their changes by edge, (N,37,600)."""
    cells, N = expansion.cells, len(expansion.Z1)
    T = np.zeros((N, 16, 10))
    T[:, :12, :6] = swap(cells.B)
    T[:, 12:, 6:] = np.eye(4)
    ET = (EQUATIONS.reshape(592, 16) @ T).reshape(N, 37, 16, 10)
    E = swap(T)[:, None] @ ET
    CET = (cells.C[:, None] @ ET[:, :, :12]).transpose(0, 2, 1, 3).reshape(N, 6, 370)
    half = (expansion.normal_rows() @ CET).reshape(N, 6, 6, 37, 10)
    changes = np.zeros((N, 37, 6, 10, 10))
    changes[:, :, :, :6] = half.transpose(0, 3, 1, 2, 4)
    changes = changes + swap(changes)
    return E[:, :, ROW, COLUMN] * SCALE, changes.reshape(N, 37, 600)


def _inequalities(F: FloatArray, limit: float) -> tuple[FloatArray, FloatArray]:
    """Return the inequalities at shared unknowns 0, (N,35), and their slopes, (N,35,15)."""
    least, most = ends(limit)
    N, every = len(F), np.arange(7)
    n = np.zeros((N, 15, 7))
    n[:, 10:14] = F
    nn = swap(F)[:, None] @ X_CHANGES[:, 1:, 1:] @ F[:, None]
    nn[:, 14] = 0
    products = nn[:, :, PAIR_I, PAIR_J] - least * (n[:, :, PAIR_I] + n[:, :, PAIR_J])
    upper = (least + most) * n - nn[:, :, every, every]
    slopes = np.concatenate([products, n, upper], 2)
    slopes[:, 14] = -1
    at_zero = np.repeat([least**2, -least, -least * most], [21, 7, 7])
    return np.tile(at_zero, (N, 1)), np.ascontiguousarray(swap(slopes))
