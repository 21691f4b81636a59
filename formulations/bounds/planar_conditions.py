"""What is claimed of a planar Jacobian, and the multipliers that prove it for a node.

z_i is the complex square of column i. A condition is about what a set S of n − k columns, which
k locked joints leave, is worth: with W = Σ_S |z_i|, Z = Σ_S z_i and a direction v (`planar`),

    2t ≤ W − Re(Z v̄),   r √(1 − |v|²) ≤ W − Re(Z v̄),   0 ≤ c W − Re(Z v̄)

for max-min, the manipulability and the condition number; c is `mass`, 1 in the first two. t is
the square of the worst case, and r the least relative manipulability. Lengths are such that
Σ|z_i| = 1, so that the level in these units is 2t/n of a J with ‖J‖_F² = n.

A cell s is an arc of the circle, the angles θ from low to high in radians, with the number of
the z_i in it. x_s is the share of them that S leaves, between 0 and 1, so that their means
stand for the z_i of a cell. ν is the multiplier of Σ z_i = 0, a condition of the
manipulability; it is 0 of the other measures.

Rounding in the closed form of `Multipliers.proved`, some 1e-14, is paid for by the claim.
"""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.nlp.arrays import FloatArray

ComplexArray: TypeAlias = NDArray[np.complex128]

Measure: TypeAlias = Literal["max-min", "manipulability", "condition"]

#: Indices of conditions, or True for each that is chosen, shape (conditions,).
Which: TypeAlias = NDArray[np.intp] | NDArray[np.bool_]

# Rounding in `Multipliers.proved` loses less than this: it takes some hundred operations on
# numbers of the size of 1.
_ROUNDING = 1e-13
# Angle in radians by which a cell counts as longer where it may contain the worst angle, which
# can only raise what is proved.
_ANGLE_SLACK_RAD = 1e-9
# Multipliers below this share of the largest are not inherited by the parts of a node.
_LEAST_SHARE = 1e-5


@dataclass(frozen=True)
class Claim:
    """What is to be proved.

    Attributes
    ----------
    measure, failures
        The measure, and k, the number of joints that lock.
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
        """Return the claim that no J of n = `joints` columns is better than a level.

        The level is that of `planar.planar_bound`. The limit of max-min is one of 2t/n. That of
        the condition number is 0: no J has 0 ≤ c W − Re(Z v̄) for all S and v.
        """
        if measure == "condition":
            mass, limit = (1 - level**2) / (1 + level**2), 0.0
        else:
            mass, limit = 1.0, 2 * level**2 / joints if measure == "max-min" else level
        return cls(measure, failures, mass, limit - _ROUNDING)


@dataclass(frozen=True)
class NodeConditions:
    """Conditions of a node, each the sum over a set S that locked joints leave.

    Attributes
    ----------
    points
        v of each condition, shape (conditions,), |v| = 1 or, of the manipulability, |v| < 1.
    masses
        c of each condition, the factor of W, shape (conditions,).
    weights
        The factor of the level: √(1 − |v|²) of the manipulability, otherwise 1, shape
        (conditions,).
    shares
        The share x_s that each condition leaves of each cell, shape (conditions, cells).
    """

    points: ComplexArray
    masses: FloatArray
    weights: FloatArray
    shares: FloatArray

    def left_at(self, corners: ComplexArray) -> FloatArray:
        """Return x_s (c − Re(e^{iθ} v̄)) for each condition at the corners e^{iθ} of each cell.

        `corners` has the shape (cells, corners), the result (conditions, cells, corners).
        """
        parts = (corners[None] * np.conj(self.points)[:, None, None]).real
        return np.asarray(self.shares[:, :, None] * (self.masses[:, None, None] - parts))

    def some(self, which: Which) -> "NodeConditions":
        """Return those that indices, or a truth value for each, choose."""
        return NodeConditions(*(values[which] for values in vars(self).values()))

    def joined(self, other: "NodeConditions") -> "NodeConditions":
        """Return these and others on the same cells."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return NodeConditions(*map(np.concatenate, pairs))


@dataclass(frozen=True)
class Multipliers:
    """What proves an upper limit of the level, whatever p and ν are.

    Attributes
    ----------
    conditions
        The conditions that are added up.
    p
        The multiplier of each condition, at least 0, shape (conditions,).
    nu
        The multiplier of Σ z_i = 0; 0 if that is not a condition.
    """

    conditions: NodeConditions
    p: FloatArray
    nu: complex

    def proved(self, low: FloatArray, high: FloatArray) -> float:
        """Return what the level is not above where all z_i are within the cells' angles.

        `low` and `high` are the ends of the cells, shape (cells,), in radians, high ≥ low. The
        sum of the conditions, each with its share of p, and of Re(ν̄ Σ z_i) = 0 says that the
        level is at most the mean, by |z_i|, of the terms constant_s − Re(wave_s e^{−iθ}):

            constant_s = Σ_j p_j c_j x_{js},   wave_s = Σ_j p_j v_j x_{js} − ν,

        so it is not above the largest of them over the cells s and over θ in [low, high]. There
        Re(wave e^{−iθ}) = |wave| cos(θ − phase) is least at an end, or is −|wave| if the angle
        opposite to the phase is in the cell.
        """
        p = self.p / (self.p @ self.conditions.weights)
        constant = (p * self.conditions.masses) @ self.conditions.shares
        wave = (p * self.conditions.points) @ self.conditions.shares - self.nu
        size, phase = np.abs(wave), np.angle(wave)
        ends = np.minimum(np.cos(low - phase), np.cos(high - phase))
        opposite = (phase + np.pi - low) % (2 * np.pi) <= high - low + _ANGLE_SLACK_RAD
        return float((constant - size * np.where(opposite, -1.0, ends)).max())

    def inherited(self, cell: int, parts: int) -> "Multipliers":
        """Return those not next to zero, where a cell is replaced by parts of it."""
        which = self.p > _LEAST_SHARE * self.p.max()
        some = self.conditions.some(which)
        times = np.ones(some.shares.shape[1], dtype=int)
        times[cell] = parts
        shares = np.repeat(some.shares, times, axis=1)
        return Multipliers(replace(some, shares=shares), self.p[which], self.nu)
