"""What is claimed of a planar Jacobian, and the multipliers that prove it for a node.

The conditions are those of `planar`. Rounding in the closed form of `Multipliers.proved`, some
1e-14, is paid for by the claim.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.nlp.arrays import FloatArray

ComplexArray: TypeAlias = NDArray[np.complex128]

Measure: TypeAlias = Literal["max-min", "manipulability", "condition"]

# Rounding in `Multipliers.proved` loses less: some hundred operations on numbers of the size of
# 1.
_ROUNDING = 1e-13


@dataclass(frozen=True)
class Claim:
    """What is to be proved.

    Attributes
    ----------
    measure, failures
        The measure, and k.
    mass
        The factor of W in the conditions: c of the condition number, otherwise 1.
    limit
        The level, in the units of the conditions, less what rounding loses.
    """

    measure: Measure
    failures: int
    mass: float
    limit: float

    @classmethod
    def of(cls, measure: Measure, joints: int, failures: int, level: float) -> "Claim":
        """Return the claim that no J of n columns is better than a level."""
        if measure == "condition":
            mass, limit = (1 - level**2) / (1 + level**2), 0.0
        else:
            mass, limit = 1.0, 2 * level**2 / joints if measure == "max-min" else level
        return cls(measure, failures, mass, limit - _ROUNDING)


@dataclass(frozen=True)
class NodeConditions:
    """Conditions of a node, one an entry.

    Attributes
    ----------
    points, masses
        v, and the factor of W.
    weights
        √(1 − |v|²) of the manipulability, otherwise 1.
    shares
        The share x_s left of each cell.
    """

    points: ComplexArray
    masses: FloatArray
    weights: FloatArray
    shares: FloatArray

    def left_at(self, corners: ComplexArray) -> FloatArray:
        """Return x_s (c − Re(e^{iθ} v̄)) for each condition and the corners of each cell."""
        parts = (corners[None] * np.conj(self.points)[:, None, None]).real
        return np.asarray(self.shares[:, :, None] * (self.masses[:, None, None] - parts))

    def some(self, which: Any) -> "NodeConditions":
        """Return those that an index of NumPy chooses."""
        return NodeConditions(*(values[which] for values in vars(self).values()))

    def joined(self, other: "NodeConditions") -> "NodeConditions":
        """Return these and others on the same cells."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return NodeConditions(*map(np.concatenate, pairs))


@dataclass(frozen=True)
class Multipliers:
    """What proves a number: p, one for each condition, and ν."""

    conditions: NodeConditions
    p: FloatArray
    nu: complex

    def proved(self, low: FloatArray, high: FloatArray) -> float:
        """Return what the level is not above where all z_i are within the cells' angles."""
        p = self.p / (self.p @ self.conditions.weights)
        constant = (p * self.conditions.masses) @ self.conditions.shares
        wave = (p * self.conditions.points) @ self.conditions.shares - self.nu
        size, phase = np.abs(wave), np.angle(wave)
        ends = np.minimum(np.cos(low - phase), np.cos(high - phase))
        opposite = (phase + np.pi - low) % (2 * np.pi) <= high - low + 1e-9
        return float((constant - size * np.where(opposite, -1.0, ends)).max())

    def inherited(self, cell: int, parts: int) -> "Multipliers":
        """Return those not next to zero, where a cell is replaced by parts of it."""
        which = self.p > 1e-5 * self.p.max()
        some = self.conditions.some(which)
        times = np.ones(some.shares.shape[1], dtype=int)
        times[cell] = parts
        shares = np.repeat(some.shares, times, axis=1)
        return Multipliers(replace(some, shares=shares), self.p[which], self.nu)
