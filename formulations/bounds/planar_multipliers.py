"""Conditions on the columns of a planar Jacobian, and multipliers of them that prove a bound.

`formulations.bounds.planar` has the mathematics.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nlp.arrays import FloatArray

ComplexArray: TypeAlias = NDArray[np.complex128]


@dataclass(frozen=True)
class NodeConditions:
    """Conditions of a node: v, √(1 − |v|²) or 1, and the share x_s left of each cell."""

    points: ComplexArray
    weights: FloatArray
    shares: FloatArray

    def some(self, which: Any) -> "NodeConditions":
        """Return those that an index of NumPy chooses."""
        return NodeConditions(self.points[which], self.weights[which], self.shares[which])

    def joined(self, other: "NodeConditions") -> "NodeConditions":
        """Return these and others on the same cells."""
        return NodeConditions(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.weights, other.weights]),
            np.concatenate([self.shares, other.shares]),
        )

    def split(self, cell: int, parts: int) -> "NodeConditions":
        """Return the conditions where a cell is replaced by parts of it."""
        times = np.ones(self.shares.shape[1], dtype=int)
        times[cell] = parts
        return NodeConditions(self.points, self.weights, np.repeat(self.shares, times, axis=1))


@dataclass(frozen=True)
class Multipliers:
    """What proves a number: p, one for each condition, and ν."""

    conditions: NodeConditions
    p: FloatArray
    nu: complex

    def proved(self, low: FloatArray, high: FloatArray) -> float:
        """Return what 2t/T or r is not above where all z_i are within the cells' angles."""
        p = self.p / (self.p @ self.conditions.weights)
        constant = p @ self.conditions.shares
        wave = (p * self.conditions.points) @ self.conditions.shares - self.nu
        size, phase = np.abs(wave), np.angle(wave)
        ends = np.minimum(np.cos(low - phase), np.cos(high - phase))
        opposite = (phase + np.pi - low) % (2 * np.pi) <= high - low + 1e-9
        return float((constant - size * np.where(opposite, -1.0, ends)).max())

    def used(self) -> "Multipliers":
        """Return those that are not next to zero."""
        which = self.p > 1e-5 * self.p.max()
        return Multipliers(self.conditions.some(which), self.p[which], self.nu)
