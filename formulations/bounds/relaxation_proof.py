"""What multipliers of the relaxation prove, in rational arithmetic.

The program is that of `lockedjoint.formulations.relaxation`: its M and Y_B are the M and Y
here, t is the square of the worst case and s = 1/t. It has the multipliers λ of the
joints' conditions ⟨A, jjᵀ⟩ = b or ≤ b on a column j, Z_F ⪰ 0 of the failures F, μ ≥ 0 and Q of
the sum of all failures in a block B of rows, and for isotropy N and π_Fg ≥ 0 of the norms. F is
a set of joints that lock, with the weight w_F; w is the least weight. J has m rows and n
columns. Z_F, N and S_g have the shape (m, m), Q, R_B and C that of the block. Joints of kind g
are n_g in number, and c_Fg of them are in F. E is the unit matrix in the units of the rows,
diag(1/unit²). Let::

    R_B = Qᵀ(μC)⁻¹Q,
    S_g = Σ λA + Σ_F (c_Fg − n_g) Z_F − n_g Σ R_B
          + n_g (N − tr N/m I) + Σ_F (π_Fg − n_g/m π_F) I,
    d = Σ_F w_F² (tr EZ_F + π_F) + Σ_B (2w tr E^½Q + w² tr ER_B − μc),       π_F = Σ_g π_Fg.

If every S_g is positive semidefinite, in the rows that joints of kind g can have, then s Σλb ≥
d, that is t ≤ Σλb/d. The sum of all failures of a block says ⟨C, Y⟩ ≤ c: this is tr Y ≤ n − m
where one joint locks, and where several lock it is the tangent of a convex condition at any
point Y₀. The residual ρ has a traceless N, and S_g = n_g N + Σ λA; then ρ ≥ −Σλb − ½‖N‖².

The check uses the parts of the program and these formulas only, no solver and no multiplier of
its own. Whether the parts are those of an arm is a question to
`lockedjoint.formulations.joints.parts.parts_of`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import isfinite
from typing import get_args

import numpy as np

from lockedjoint.formulations.bounds.exact_matrices import (
    Exact,
    exact,
    is_semidefinite,
    solved,
    zeros,
)
from lockedjoint.formulations.bounds.rational_roots import root_above
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.gram_conditions import GramCondition
from lockedjoint.formulations.joints.parts import Block, Parts, Statement

# Number of doubles by which a limit b is moved to the safe side, for what rounding lost when it
# was computed: limits such as ℓ² + c² are rounded twice in a row, and their mean once more.
_ROUNDINGS = 3


@dataclass(frozen=True, eq=False)
class BlockSum:
    """Multipliers of the summed conditions of a block of rows.

    Attributes
    ----------
    weight
        μ, at least 0.
    inverse
        Q, shape (m_B, m_B).
    point
        Y₀, symmetric, where the condition of several locked joints is replaced by its tangent.
    """

    weight: Fraction
    inverse: Exact
    point: Exact


@dataclass(frozen=True, eq=False)
class RelaxationProof:
    """Multipliers, all rational, and what they are claimed to prove.

    Attributes
    ----------
    statement, parts
        The program.
    conditions
        λ of each condition (inner tuple) of each kind of joint (outer tuple); at least 0 where
        the condition is an inequality. A condition on the mean over several kinds of joint has
        one multiplier: each kind has the part of it that it has of these joints.
    failures
        Z_F of each failure, shape (m, m); empty for the residual.
    sums
        μ, Q and Y₀ of each block of rows; empty for the residual.
    isotropic
        N, shape (m, m); zero for ``max-min``.
    norms
        π_Fg of each kind of joint (inner tuple) and failure (outer tuple), at least 0; empty
        but for ``isotropy``.
    level
        The claim: t, the square of the worst case, is not above it, or ρ not below.
    """

    statement: Statement
    parts: Parts
    conditions: tuple[tuple[Fraction, ...], ...]
    failures: tuple[Exact, ...]
    sums: tuple[BlockSum, ...]
    isotropic: Exact
    norms: tuple[tuple[Fraction, ...], ...]
    level: Fraction

    @property
    def bound(self) -> float:
        """The claim as a bound on the score: on σ rounded up, on the residual down, or 0."""
        if self.statement != "residual":
            return root_above(self.level)
        if self.level <= 0:
            return 0.0
        below = float(self.level)
        return below if Fraction(below) <= self.level else math.nextafter(below, -math.inf)

    def check(self) -> None:
        """Raise CertificateError unless the multipliers prove the claim."""
        self._check_form()
        self._check_signs()
        pairs = zip(self.parts.kinds, self.slacks, strict=True)
        if not all(is_semidefinite(kind.on_support(slack)) for kind, slack in pairs):
            raise CertificateError("the multipliers do not add up to semidefinite matrices")
        proved = self.proved_level()
        falls_short = (
            self.level > proved if self.statement == "residual" else self.level < proved
        )
        if falls_short:
            raise CertificateError(f"the multipliers prove {float(proved):.12g} only")

    @cached_property
    def slacks(self) -> list[Exact]:
        """S_g of each kind of joint, shape (m, m)."""
        m = self.parts.task_dimension
        return [
            self.without_conditions(place)
            + sum(
                (
                    weight * exact(condition.matrix)
                    for weight, condition in zip(
                        self.conditions[place], kind.conditions, strict=True
                    )
                ),
                zeros(m),
            )
            for place, kind in enumerate(self.parts.kinds)
        ]

    def without_conditions(self, place: int) -> Exact:
        """Return S_g without the part Σ λA, for the kind of joint at this place."""
        total: Exact = self.parts.kinds[place].count * self._of_each_joint
        if self.statement == "residual":
            return total
        for failure, multiplier in zip(self.parts.sets, self.failures, strict=True):
            if failure.counts[place]:
                total = total + failure.counts[place] * multiplier
        if self.statement == "isotropy":
            norms = sum((of_one[place] for of_one in self.norms), Fraction(0))
            total = total + norms * exact(np.eye(self.parts.task_dimension))
        return total

    @cached_property
    def _of_each_joint(self) -> Exact:
        """The part N − tr N/m I − Σ Z_F − Σ R_B − Σπ/m I of S_g/n_g, the same for all kinds.

        It is the multiplier of M, to which each joint contributes its column. For the residual
        N is all.
        """
        m = self.parts.task_dimension
        unit = exact(np.eye(m))
        total: Exact = self.isotropic - np.trace(self.isotropic) / Fraction(m) * unit
        if self.statement == "residual":
            return total
        for multiplier in self.failures:
            total = total - multiplier
        for block, remainder in zip(self.parts.blocks, self.remainders, strict=True):
            total[block.rows, block.rows] -= remainder
        return total - sum(map(sum, self.norms), Fraction(0)) / m * unit

    @cached_property
    def tangents(self) -> list[tuple[Exact, Fraction]]:
        """C, shape (m_B, m_B), and c of each block."""
        pairs = zip(self.parts.blocks, self.sums, strict=True)
        return [tangent_of_sum(self.parts, block, one.point) for block, one in pairs]

    @cached_property
    def remainders(self) -> list[Exact]:
        """R_B = Qᵀ(μC)⁻¹Q of each block, shape (m_B, m_B); 0 where μ is 0."""
        found = []
        for block, one, (matrix, _) in zip(
            self.parts.blocks, self.sums, self.tangents, strict=True
        ):
            if one.weight == 0:
                found.append(zeros(block.size))
            else:
                found.append(one.inverse.T @ solved(one.weight * matrix, one.inverse))
        return found

    def proved_level(
        self, conditions: tuple[tuple[Fraction, ...], ...] | None = None
    ) -> Fraction:
        """Return what t is not above, or ρ not below, if all slacks are semidefinite.

        It is Σλb/d, or −Σλb − ½‖N‖² for the residual; CertificateError unless d > 0. The λ are
        `conditions`, by default those of the proof.
        """
        price = Fraction(0)
        given = self.conditions if conditions is None else conditions
        for kind, weights in zip(self.parts.kinds, given, strict=True):
            for condition, weight in zip(kind.conditions, weights, strict=True):
                price += weight * limit_of(condition, weight)
        if self.statement == "residual":
            m = self.parts.task_dimension
            traceless = self.isotropic - np.trace(self.isotropic) / Fraction(m) * exact(
                np.eye(m)
            )
            return -price - Fraction(1, 2) * Fraction(np.sum(traceless * traceless))
        gained = self._gained()
        if gained <= 0:
            raise CertificateError("the multipliers prove nothing")
        return max(price / gained, Fraction(0))

    @cached_property
    def _unit(self) -> Exact:
        """E, the unit matrix in the units of the rows."""
        return exact(np.diag([1 / Fraction(unit) ** 2 for unit in self.parts.units]))

    def _gained(self) -> Fraction:
        """Return d of the header; w is `least_weight` of the parts."""
        total = Fraction(0)
        for number, failure in enumerate(self.parts.sets):
            norms = self.norms[number] if self.statement == "isotropy" else ()
            both = np.trace(self._unit @ self.failures[number]) + sum(norms, Fraction(0))
            total += Fraction(failure.weight) ** 2 * both
        w = Fraction(self.parts.least_weight)
        for block, (_, limit), one, remainder in zip(
            self.parts.blocks, self.tangents, self.sums, self.remainders, strict=True
        ):
            unit = self._unit[block.rows, block.rows]
            root = exact(np.diag([1 / Fraction(x) for x in self.parts.units[block.rows]]))
            total += 2 * w * np.trace(root @ one.inverse) + w**2 * np.trace(unit @ remainder)
            total -= one.weight * limit
        return total

    def _check_form(self) -> None:
        """Raise CertificateError unless every number of the formulas is a fraction."""
        parts, m = self.parts, self.parts.task_dimension
        if self.statement not in get_args(Statement):
            raise CertificateError(f"there is no statement {self.statement!r:.50}")
        _check_parts(parts)
        residual, isotropy = self.statement == "residual", self.statement == "isotropy"
        if residual or isotropy:
            _require(set(parts.units) == {1.0}, "rows have units in a statement without them")
        _check_numbers("level", [self.level], 1)
        _check_length("conditions", self.conditions, len(parts.kinds))
        for kind, weights in zip(parts.kinds, self.conditions, strict=True):
            _check_numbers("conditions", weights, len(kind.conditions))
        _check_matrix("isotropic", self.isotropic, m)
        _require(np.array_equal(self.isotropic, self.isotropic.T), "isotropic is not symmetric")
        _check_length("failures", self.failures, 0 if residual else len(parts.sets))
        for matrix in self.failures:
            _check_matrix("failures", matrix, m)
        _check_length("sums", self.sums, 0 if residual else len(parts.blocks))
        for block, one in zip(parts.blocks, self.sums, strict=not residual):
            _require(isinstance(one, BlockSum), "sums are not of blocks")
            _check_numbers("weight", [one.weight], 1)
            _check_matrix("inverse", one.inverse, block.size)
            _check_matrix("point", one.point, block.size)
            _require(np.array_equal(one.point, one.point.T), "point is not symmetric")
        _check_length("norms", self.norms, len(parts.sets) if isotropy else 0)
        for failure, of_one in zip(parts.sets, self.norms, strict=isotropy):
            _check_numbers("norms", of_one, len(parts.kinds))
            unlocked = (x for x, count in zip(of_one, failure.counts, strict=True) if not count)
            _require(
                not any(unlocked), "a joint that does not lock has a multiplier of its norm"
            )

    def _check_signs(self) -> None:
        """Raise CertificateError unless multipliers of inequalities are on the right side.

        λ, π and μ are at least 0 where they belong to inequalities, Z_F is semidefinite, and C
        definite where μ > 0. A shared condition has one multiplier, λ/n_g the same for all g.
        """
        for kind, weights in zip(self.parts.kinds, self.conditions, strict=True):
            for condition, weight in zip(kind.conditions, weights, strict=True):
                if weight < 0 and not condition.equal:
                    raise CertificateError(f"the multiplier of {condition.name} is negative")
        for number, kind in enumerate(self.parts.kinds):
            for place, condition in enumerate(kind.conditions):
                each = {
                    self.conditions[k][place] / self.parts.kinds[k].count
                    for k in (self.parts.alike(number) if condition.shared else (number,))
                }
                if len(each) > 1:
                    raise CertificateError(f"{condition.name} has more than one multiplier")
        if any(weight < 0 for weights in self.norms for weight in weights):
            raise CertificateError("the multiplier of a norm is negative")
        if self.statement == "max-min" and (np.any(self.isotropic) or self.norms):
            raise CertificateError("isotropy has multipliers in a statement without it")
        if self.statement == "residual":
            return
        if not all(map(is_semidefinite, self.failures)):
            raise CertificateError("the multiplier of a failure is not semidefinite")
        for block, one, (matrix, _) in zip(
            self.parts.blocks, self.sums, self.tangents, strict=True
        ):
            if one.weight < 0 or (one.weight == 0 and np.any(one.inverse)):
                raise CertificateError(f"the multiplier of {block.name} has no weight")
            if one.weight > 0 and not is_semidefinite(matrix, strictly=True):
                raise CertificateError(f"the tangent of {block.name} is not definite")


def _check_parts(parts: Parts) -> None:
    """Raise CertificateError unless counts, weights and units are what the formulas take."""
    m = parts.task_dimension
    _require(len(parts.units) == m, "rows have units that are not as many")
    _require(all(isfinite(x) and x >= 1 for x in parts.units), "a unit is below 1")
    _require(all(kind.count >= 1 for kind in parts.kinds), "there are no joints of a kind")
    for failure in parts.sets:
        _check_length("counts", failure.counts, len(parts.kinds))
        _require(isfinite(failure.weight) and failure.weight > 0, "a failure has no weight")
        pairs = zip(failure.counts, parts.kinds, strict=True)
        _require(
            all(0 <= count <= kind.count for count, kind in pairs)
            and sum(failure.counts) == parts.failures,
            "a failure is not of as many joints as lock",
        )
    for kind in parts.kinds:
        for one in kind.conditions:
            matrix = np.array(one.matrix, dtype=float)
            _require(matrix.shape == (m, m), f"{one.name} is not on {m} rows")
            finite = isfinite(one.limit) and bool(np.all(np.isfinite(matrix)))
            _require(finite, f"{one.name} is not finite")


def _require(holds: bool, otherwise: str) -> None:
    """Raise CertificateError with the sentence `otherwise` unless a condition holds."""
    if not holds:
        raise CertificateError(otherwise)


def _check_length(name: str, values: object, length: int) -> None:
    """Raise CertificateError unless values are a tuple of this length."""
    if not isinstance(values, tuple) or len(values) != length:
        raise CertificateError(f"{name} are not a tuple of {length}")


def _check_numbers(name: str, values: Sequence[object], length: int) -> None:
    """Raise CertificateError unless values are as many fractions, in a tuple or a list."""
    fractions = isinstance(values, (tuple, list)) and all(
        isinstance(x, Fraction) for x in values
    )
    if not fractions or len(values) != length:
        raise CertificateError(f"{name} is not a fraction for each of {length}")


def _check_matrix(name: str, matrix: object, size: int) -> None:
    """Raise CertificateError unless a matrix has the shape (size, size), all fractions."""
    if not isinstance(matrix, np.ndarray) or matrix.shape != (size, size):
        raise CertificateError(f"{name} is not a matrix of {size} rows and columns")
    if not all(isinstance(x, Fraction) for x in matrix.ravel()):
        raise CertificateError(f"{name} has entries that are no fractions")


def limit_of(condition: GramCondition, weight: Fraction) -> Fraction:
    """Return the limit b of a condition as a fraction, moved to where the bound holds.

    b is a sum of squares, rounded thrice. A larger λb makes the bound weaker: b is raised
    if its multiplier `weight` is at least 0, and lowered otherwise.
    """
    limit, away = condition.limit, math.inf if weight >= 0 else -math.inf
    for _ in range(_ROUNDINGS):
        limit = math.nextafter(limit, away)
    return Fraction(limit)


def tangent_of_sum(parts: Parts, block: Block, point: Exact) -> tuple[Exact, Fraction]:
    """Return C, (m_B, m_B), and c of ⟨C, Y⟩ ≤ c, what the failures of a block leave of Y.

    One locked joint says tr Y ≤ n − m. If k of n joints lock, the condition is, with
    α = (k − 1)/(n − 1),

        f(Y) = (1 − α)(m + tr Y)²/n − (m + tr Y) + α(m + 2 tr Y + ‖Y‖²) ≤ 0,

    where m = m_B and n is the number of joints that reach the block. f is convex: its tangent
    at Y₀ = `point` says ⟨C, Y⟩ ≤ ⟨C, Y₀⟩ − f(Y₀), C the gradient of f at Y₀.
    """
    m, n, k = block.size, block.joints, parts.failures
    unit = exact(np.eye(m))
    if k == 1 or k >= n:
        return unit, Fraction(n - m)
    alpha, trace = Fraction(k - 1, n - 1), Fraction(np.trace(point))
    slope = 2 * (1 - alpha) * (m + trace) / n + 2 * alpha - 1
    matrix = slope * unit + 2 * alpha * point
    value = (1 - alpha) * (m + trace) ** 2 / n - (m + trace)
    value += alpha * (m + 2 * trace + Fraction(np.sum(point * point)))
    return matrix, Fraction(np.sum(matrix * point)) - value
