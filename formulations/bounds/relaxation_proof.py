"""What multipliers of the relaxation prove, in rational arithmetic.

With the multipliers λ of the joints' conditions, Z_F ⪰ 0 of the failures, μ ≥ 0 and Q of the
blocks' sums, and of isotropy N and π ≥ 0 (`lockedjoint.formulations.relaxation`), let

    R_B = Qᵀ(μC)⁻¹Q,
    S_g = Σ λA + Σ_F (c_F − n_g) Z_F − n_g Σ R_B + n_g (N − tr N/m I) + Σ (π_Fg − n_g/m Σπ) I,
    d = Σ_F w_F² (tr Z_F + Σπ_F) + Σ_B (2w tr Q + w² tr R_B − μc).

If every S_g is positive semidefinite then s Σλb ≥ d, that is t ≤ Σλb/d. A block's sum says
⟨C, Y⟩ ≤ c: of one locked joint tr Y ≤ n − m, of several the tangent of its convex condition at
any Y₀. Of the residual, with N traceless: S_g = n_g N + Σ λA, and ρ ≥ −Σλb − ½‖N‖².

The check uses the parts of the program and these formulas only, no solver and no multiplier of
its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.closed_form import root_above
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.joint import GramCondition
from lockedjoint.formulations.relaxation import Block, Parts, Statement

#: A matrix of fractions.
Exact: TypeAlias = NDArray[Any]


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
        λ of the conditions of each kind of joint; at least 0 where these are inequalities.
        Of a condition on the mean, its multiplier times the share of these joints.
    failures
        Z_F of each failure.
    sums
        Of each block of rows; empty for the residual.
    isotropic
        N; zero for ``max-min``.
    norms
        π of each failure and kind of joint, at least 0; for ``isotropy`` only.
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
        """The claim as a bound on the score: on σ rounded up, on the residual rounded down."""
        if self.statement != "residual":
            return root_above(self.level)
        below = float(self.level)
        return below if Fraction(below) <= self.level else math.nextafter(below, -math.inf)

    def check(self) -> None:
        """Raise CertificateError unless the multipliers prove the claim."""
        self._check_signs()
        if not all(map(is_semidefinite, self.slacks)):
            raise CertificateError("the multipliers do not add up to semidefinite matrices")
        proved = self.proved_level()
        falls_short = (
            self.level > proved if self.statement == "residual" else self.level < proved
        )
        if falls_short:
            raise CertificateError(f"the multipliers prove {float(proved):.12g} only")

    @cached_property
    def slacks(self) -> list[Exact]:
        """S_g of each kind of joint."""
        m = self.parts.task_dimension
        return [
            self.without_conditions(place)
            + sum(
                (
                    weight * exact(condition.matrix)
                    for weight, condition in zip(
                        self.conditions[place], kind.joint.gram_conditions, strict=True
                    )
                ),
                zeros(m),
            )
            for place, kind in enumerate(self.parts.kinds)
        ]

    def without_conditions(self, place: int) -> Exact:
        """Return S_g of a kind of joint without the part Σ λA."""
        total: Exact = self.parts.kinds[place].count * self._of_each_joint
        if self.statement == "residual":
            return total
        for failure, multiplier in zip(self.parts.failures, self.failures, strict=True):
            if failure.counts[place]:
                total = total + failure.counts[place] * multiplier
        if self.statement == "isotropy":
            norms = sum((of_one[place] for of_one in self.norms), Fraction(0))
            total = total + norms * exact(np.eye(self.parts.task_dimension))
        return total

    @cached_property
    def _of_each_joint(self) -> Exact:
        """N − tr N/m I − Σ Z_F − Σ R_B − Σπ/m I: what each joint's column adds to M."""
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
        """C and c of each block."""
        pairs = zip(self.parts.blocks, self.sums, strict=True)
        return [spent(self.parts, block, one.point) for block, one in pairs]

    @cached_property
    def remainders(self) -> list[Exact]:
        """R_B of each block."""
        found = []
        for block, one, (matrix, _) in zip(
            self.parts.blocks, self.sums, self.tangents, strict=True
        ):
            if one.weight == 0:
                found.append(zeros(block.size))
            else:
                found.append(one.inverse.T @ solved(one.weight * matrix, one.inverse))
        return found

    def proved_level(self) -> Fraction:
        """Return what t is not above, or ρ not below, if all slacks are semidefinite."""
        price = Fraction(0)
        for kind, weights in zip(self.parts.kinds, self.conditions, strict=True):
            for condition, weight in zip(kind.joint.gram_conditions, weights, strict=True):
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

    def _gained(self) -> Fraction:
        """Return d."""
        total = Fraction(0)
        for number, failure in enumerate(self.parts.failures):
            norms = self.norms[number] if self.statement == "isotropy" else ()
            both = np.trace(self.failures[number]) + sum(norms, Fraction(0))
            total += Fraction(failure.weight) ** 2 * both
        w = Fraction(self.parts.least_weight)
        for (_, limit), one, remainder in zip(
            self.tangents, self.sums, self.remainders, strict=True
        ):
            total += 2 * w * np.trace(one.inverse) + w**2 * np.trace(remainder)
            total -= one.weight * limit
        return total

    def _check_signs(self) -> None:
        for kind, weights in zip(self.parts.kinds, self.conditions, strict=True):
            for condition, weight in zip(kind.joint.gram_conditions, weights, strict=True):
                if weight < 0 and not condition.equal:
                    raise CertificateError(f"the multiplier of {condition.name} is negative")
        for number, kind in enumerate(self.parts.kinds):
            for place, condition in enumerate(kind.joint.gram_conditions):
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


def limit_of(condition: GramCondition, weight: Fraction) -> Fraction:
    """Return b, on the side that makes the bound hold: b is correct to a rounding only."""
    return Fraction(math.nextafter(condition.limit, math.inf if weight >= 0 else -math.inf))


def spent(parts: Parts, block: Block, point: Exact) -> tuple[Exact, Fraction]:
    """Return C and c of ⟨C, Y⟩ ≤ c, what the failures of a block's joints leave of Y."""
    m, n, k = block.size, block.joints, parts.locked
    unit = exact(np.eye(m))
    if k == 1 or k >= n:
        return unit, Fraction(n - m)
    share, trace = Fraction(k - 1, n - 1), Fraction(np.trace(point))
    slope = 2 * (1 - share) * (m + trace) / n + 2 * share - 1
    matrix = slope * unit + 2 * share * point
    value = (1 - share) * (m + trace) ** 2 / n - (m + trace)
    value += share * (m + 2 * trace + Fraction(np.sum(point * point)))
    return matrix, Fraction(np.sum(matrix * point)) - value


def exact(values: Any) -> Exact:
    """Return numbers as the fractions that they are."""
    array = np.array(values, dtype=object)
    return np.array([Fraction(x) for x in array.ravel()], dtype=object).reshape(array.shape)


def zeros(size: int) -> Exact:
    """Return the square matrix of zeros."""
    return exact(np.zeros((size, size)))


def solved(matrix: Exact, right: Exact) -> Exact:
    """Return the exact solution of a system with a positive definite matrix."""
    rows = [[*row, *other] for row, other in zip(matrix.tolist(), right.tolist(), strict=True)]
    size = len(rows)
    for k in range(size):
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(size):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return np.array([row[size:] for row in rows], dtype=object)


def is_semidefinite(matrix: Exact, strictly: bool = False) -> bool:
    """Whether a symmetric matrix of fractions is positive semidefinite, or definite."""
    if not np.array_equal(matrix, matrix.T):
        return False
    rows: list[Sequence[Fraction]] = matrix.tolist()
    while rows:
        pivot, *first = rows[0]
        if pivot < 0 or (pivot == 0 and (strictly or any(first))):
            return False
        rest = [row[1:] for row in rows[1:]]
        if pivot > 0:
            rest = [
                [x - below * y / pivot for x, y in zip(row, first, strict=True)]
                for row, below in zip(rest, first, strict=True)
            ]
        rows = list(rest)
    return True
