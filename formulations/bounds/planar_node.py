"""Nodes of the search for planar Jacobians: linear programs, whose multipliers prove a number.

The linear program goes to Clarabel directly. Through cvxpy, with parameters, each takes four
times as long; the tests state it there.
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

# The largest number of linear programs of a node.
_MOST_PROGRAMS = 12

# Directions v that are tried first, on the unit circle.
_DIRECTIONS = np.exp(2j * np.pi * np.arange(48) / 48)

_SETTINGS = clarabel.DefaultSettings()
_SETTINGS.verbose = _SETTINGS.equilibrate_enable = False
_SETTINGS.tol_gap_abs = _SETTINGS.tol_gap_rel = _SETTINGS.tol_feas = 1e-10


class Node:
    """How many z_i each cell of the circle holds."""

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
        """Return the nodes that this one divides into; none if it is proved to be below."""
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
            if values.min() > limit or values.min() > value - 1e-10:
                break
            first = np.argsort(values)[:8]
            conditions = conditions.joined(new.some(first[values[first] < value]))
        loss = masses.sum(axis=1) - np.abs((masses * corners).sum(axis=1))
        width = self._high - self._low
        # The cell whose mean is least like the square of a column.
        widest = int(np.argmax(np.where(width > 0, loss + 1e-6 * width, -1.0)))
        return self._halved(best, widest)

    def _program(
        self, corners: ComplexArray, conditions: NodeConditions
    ) -> tuple[FloatArray, float, Multipliers | None]:
        """Return Σ w_i at the corners of the cells, the value, and the multipliers."""
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
        if not np.isfinite(p).all() or not 0.5 < p @ conditions.weights < 2.0:
            return np.ones(corners.shape), math.inf, None  # nothing can be there, or it failed
        nu = -complex(*found.z[1:3]) if len(equal) > 1 else 0j
        masses = np.maximum(np.array(found.x)[:-1], 0.0).reshape(corners.shape)
        return masses, float(found.x[-1]), Multipliers(conditions, p, nu)

    def _tightest(self, mass: FloatArray, mean: ComplexArray) -> NodeConditions:
        """Return the conditions that means of |z_i| and z_i of the cells violate most."""
        inside = self._claim.measure == "manipulability"
        radii = [0.3, 0.8] if inside else [1.0]
        points = np.outer(radii, _DIRECTIONS).ravel()
        for _ in range(3):
            shares = self._left(mass, mean, points)
            left = (shares * self._counts) @ np.stack([mass, mean], axis=1)
            radius = np.abs(left[:, 0] if inside else left[:, 1])
            sure = radius > 1e-9
            points = np.where(sure, left[:, 1] / np.where(sure, radius, 1.0), points)
        _, apart = np.unique(np.round(points, 3), return_index=True)  # many become the same
        points, shares = points[apart], shares[apart]
        masses = np.full(len(points), self._claim.mass)
        if not inside:
            return NodeConditions(points, masses, np.ones(len(points)), shares)
        points = points * np.minimum(1.0, 0.999999 / np.maximum(np.abs(points), 1e-9))
        return NodeConditions(points, masses, np.sqrt(1 - np.abs(points) ** 2), shares)

    def _left(self, mass: FloatArray, mean: ComplexArray, points: ComplexArray) -> FloatArray:
        """Return the shares that are left where the k locked ones leave least at each v."""
        terms = self._claim.mass * mass - (np.conj(points)[:, None] * mean).real
        order = np.argsort(-terms, axis=1)
        counts = self._counts[order]
        taken = np.clip(self._claim.failures - (np.cumsum(counts, axis=1) - counts), 0, counts)
        shares = np.empty_like(terms)
        np.put_along_axis(shares, order, 1 - taken / counts, axis=1)
        return shares

    def _halved(self, known: Multipliers | None, index: int) -> list["Node"]:
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
