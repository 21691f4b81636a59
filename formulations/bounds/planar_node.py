"""Nodes of the search for planar Jacobians: linear programs, whose multipliers prove a number.

A node says how many z_i, the complex squares of columns, each cell of the circle holds. It is
excluded if multipliers prove that the level is not reached there; otherwise one of its cells is
cut in two, and each count of the z_i in the halves is a node again. Letters are those of
`planar_conditions`. Angles are in radians, and Σ|z_i| = 1.

The linear program: its unknowns are a mass w ≥ 0 at each corner e^{iθ} of each cell, which
stands for the |z_i| there, and the level s::

    maximise    s
    subject to  Σ w = 1,
                Σ w x_s (c − Re(e^{iθ} v̄)) ≥ s · weight  for each condition (v, S),
                Σ w e^{iθ} = 0                           for the manipulability only.

Conditions are added until none is violated, or until the multipliers prove enough. What is
proved does not depend on the numbers below: they decide how many nodes there are, and how long
each takes.

The program goes to Clarabel directly. Through cvxpy, with parameters, each takes four times as
long; the tests state it there.
"""

import math

import clarabel
import numpy as np
from scipy.sparse import csc_matrix

from lockedjoint.formulations.bounds.planar_cells import TURN, Cell, is_crowded, is_one_sided
from lockedjoint.formulations.bounds.planar_conditions import (
    Claim,
    ComplexArray,
    Multipliers,
    NodeConditions,
)
from lockedjoint.nlp.arrays import FloatArray

# Largest number of linear programs of a node. After these it is cut.
_MOST_PROGRAMS = 12
# Largest number of conditions that are added at once: those that are violated most.
_CONDITIONS_AT_ONCE = 8
# Decrease of s by which a new condition must be violated; less is what the solver loses.
_LEAST_VIOLATION = 1e-10
# Number of directions v that are tried first, on the unit circle.
_DIRECTION_COUNT = 48
# These directions, shape (directions,).
_DIRECTIONS = np.exp(2j * np.pi * np.arange(_DIRECTION_COUNT) / _DIRECTION_COUNT)
# Absolute values of the v that are tried first where |v| < 1.
_INNER_RADII = (0.3, 0.8)
# Number of times that v is replaced by the one that is worst for its set S.
_IMPROVEMENTS = 3
# Length of Σ_S z_i, or of Σ_S |z_i|, below which it has no direction to follow.
_NO_DIRECTION = 1e-9
# Number of decimals to which two v are the same.
_DECIMALS = 3
# Largest |v| of the manipulability: the weight √(1 − |v|²) is above 0 there.
_LARGEST_RADIUS = 0.999999
# What an angle of a cell counts in the choice of the cell to be cut, beside the loss of mass.
# It decides where no cell loses anything.
_WEIGHT_OF_WIDTH = 1e-6
# Sum of p · weights, which is 1 in exact arithmetic, below which the solver has failed.
_LEAST_SUM = 0.5
# The same sum above which the solver has failed.
_LARGEST_SUM = 2.0

# Clarabel's tolerances are small: multipliers of a better accuracy prove more.
_SETTINGS = clarabel.DefaultSettings()
_SETTINGS.verbose = _SETTINGS.equilibrate_enable = False
_SETTINGS.tol_gap_abs = _SETTINGS.tol_gap_rel = _SETTINGS.tol_feas = 1e-10


class Node:
    """How many z_i each cell of the circle holds.

    Parameters
    ----------
    cells
        The cells that hold any z_i, with their numbers.
    claim
        What is to be proved.
    known
        Multipliers of the node from which this one was cut, with shares of these cells; None
        for a first node.
    """

    def __init__(
        self,
        cells: tuple[Cell, ...],
        claim: Claim,
        known: Multipliers | None = None,
    ) -> None:
        self._cells, self._claim, self._known = cells, claim, known
        self._counts = np.array([count for _, _, count in cells], dtype=np.float64)
        self._low = np.array([low for low, _, _ in cells]) * (2 * np.pi / TURN)
        self._high = np.array([high for _, high, _ in cells]) * (2 * np.pi / TURN)

    def parts(self) -> list["Node"]:
        """Return the nodes that this one divides into; none if it is excluded."""
        known, limit = self._known, self._claim.limit
        if self._claim.measure == "manipulability" and is_one_sided(self._cells):
            return []
        if known and known.proved(self._low, self._high) <= limit:
            return []
        middle = 0.5 * (self._low + self._high)
        corners = np.exp(1j * np.stack([self._low, middle, self._high], axis=1))
        even = np.full_like(self._counts, 1 / self._counts.sum())
        conditions = known.conditions if known else self._tightest(even, even * corners[:, 1])
        best, least, masses = known, math.inf, np.zeros(corners.shape)
        for _ in range(_MOST_PROGRAMS):
            masses, value, multipliers = self._program(corners, conditions)
            if multipliers is None:
                break
            proved = multipliers.proved(self._low, self._high)
            if proved <= limit:
                return []
            if proved < least:
                best, least = multipliers, proved
            means = masses / self._counts[:, None]
            new = self._tightest(means.sum(axis=1), (means * corners).sum(axis=1))
            values = np.sum(new.left_at(corners) * masses, axis=(1, 2)) / new.weights
            if values.min() > limit or values.min() > value - _LEAST_VIOLATION:
                break
            first = np.argsort(values)[:_CONDITIONS_AT_ONCE]
            conditions = conditions.joined(new.some(first[values[first] < value]))
        # The cell is cut whose mean is least like one z: |Σ w e^{iθ}| is most below Σ w.
        loss = masses.sum(axis=1) - np.abs((masses * corners).sum(axis=1))
        width = self._high - self._low
        score = np.where(width > 0, loss + _WEIGHT_OF_WIDTH * width, -1.0)
        return self._halved(best, int(np.argmax(score)))

    def _program(
        self, corners: ComplexArray, conditions: NodeConditions
    ) -> tuple[FloatArray, float, Multipliers | None]:
        """Return the masses w, the level s and the multipliers of the linear program.

        `corners` are the e^{iθ}, and w has its shape, (cells, corners of a cell). Where nothing
        satisfies the program, or the solver fails, there are no multipliers and s is infinite.
        """
        # Clarabel takes rows · x + slack = b, with a slack of 0 in the first rows and at least
        # 0 in the others. x is all w, then s; b is 1 in the row of Σ w and 0 elsewhere.
        left = conditions.left_at(corners)
        size, count = corners.size, len(left)
        equal = [np.ones(size)]
        if self._claim.measure == "manipulability":
            equal += [corners.real.ravel(), corners.imag.ravel()]
        parts = [np.array(equal), -left.reshape(count, size), -np.eye(size)]
        last = [np.zeros(len(equal)), conditions.weights, np.zeros(size)]
        rows = np.column_stack([np.concatenate(parts), np.concatenate(last)])
        found = clarabel.DefaultSolver(
            csc_matrix((size + 1, size + 1)),
            np.append(np.zeros(size), -1.0),
            csc_matrix(rows),
            np.eye(len(rows))[0],
            [clarabel.ZeroConeT(len(equal)), clarabel.NonnegativeConeT(count + size)],
            _SETTINGS,
        ).solve()
        p = np.maximum(np.array(found.z)[len(equal) : len(equal) + count], 0.0)
        if not np.isfinite(p).all() or not _LEAST_SUM < p @ conditions.weights < _LARGEST_SUM:
            return np.ones(corners.shape), math.inf, None
        nu = -complex(*found.z[1:3]) if len(equal) > 1 else 0j
        masses = np.maximum(np.array(found.x)[:-1], 0.0).reshape(corners.shape)
        return masses, float(found.x[-1]), Multipliers(conditions, p, nu)

    def _tightest(self, mass: FloatArray, mean: ComplexArray) -> NodeConditions:
        """Return the conditions that means of the cells violate most.

        `mass` and `mean` are the means of |z_i| and of z_i in each cell, shape (cells,). From
        each of some v the set S follows that is worst for it, then the v that is worst for S,
        and so on. For a set the worst v is Z/|Z|, and Z/W for the manipulability.
        """
        inside = self._claim.measure == "manipulability"
        radii = _INNER_RADII if inside else (1.0,)
        points = np.outer(radii, _DIRECTIONS).ravel()
        for _ in range(_IMPROVEMENTS):
            shares = self._least_shares(mass, mean, points)
            # W and Z of each S, shape (points, 2).
            left = (shares * self._counts) @ np.stack([mass, mean], axis=1)
            radius = np.abs(left[:, 0] if inside else left[:, 1])
            sure = radius > _NO_DIRECTION
            points = np.where(sure, left[:, 1] / np.where(sure, radius, 1.0), points)
        # Many of them become the same.
        _, apart = np.unique(np.round(points, _DECIMALS), return_index=True)
        points, shares = points[apart], shares[apart]
        masses = np.full(len(points), self._claim.mass)
        if not inside:
            return NodeConditions(points, masses, np.ones(len(points)), shares)
        lengths = np.maximum(np.abs(points), _NO_DIRECTION)
        points = points * np.minimum(1.0, _LARGEST_RADIUS / lengths)
        return NodeConditions(points, masses, np.sqrt(1 - np.abs(points) ** 2), shares)

    def _least_shares(
        self, mass: FloatArray, mean: ComplexArray, points: ComplexArray
    ) -> FloatArray:
        """Return the shares x_s of the S that leaves least at each v, shape (points, cells).

        The k locked columns are those with the largest c|z| − Re(z v̄), with the means of their
        cells; a cell may lose some of its columns only.
        """
        terms = self._claim.mass * mass - (np.conj(points)[:, None] * mean).real
        order = np.argsort(-terms, axis=1)
        counts = self._counts[order]
        taken = np.clip(self._claim.failures - (np.cumsum(counts, axis=1) - counts), 0, counts)
        shares = np.empty_like(terms)
        np.put_along_axis(shares, order, 1 - taken / counts, axis=1)
        return shares

    def _halved(self, known: Multipliers | None, index: int) -> list["Node"]:
        """Return the nodes in which the cell with this index is cut in the middle.

        There is one for each number of its z_i in the lower half. Those that are not among the
        rotations that `first_cells` makes are left out.
        """
        low, high, count = self._cells[index]
        middle = (low + high) // 2
        nodes = []
        for below in range(count + 1):
            halves = [(low, middle, below), (middle, high, count - below)]
            held = [half for half in halves if half[2]]
            cells = (*self._cells[:index], *held, *self._cells[index + 1 :])
            if is_crowded(cells):
                continue
            inherited = known and known.inherited(index, len(held))
            nodes.append(Node(cells, self._claim, inherited))
        return nodes
