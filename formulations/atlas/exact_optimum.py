"""Optima of free columns in exact numbers: the worst case as a root of a polynomial, proved.

Columns of an exact J are j_f = ±√w_f B x_f, with a frame B that is known by S = BᵀB only, so
that numbers of small fields suffice. With A_F = J_F̄J_F̄ᵀ, t = σ², u_F = B⁻ᵀv_F the conditions

    M_F v_F = 0,  M_F = Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹,    Σ_{F∌f} c_F (v_F·x_f) v_F = λ_f S x_f

say that A_F u_F = tu_F and that Σ c_F ∇λ_F is a multiple of the gradient of the model. What is
positive is decided in whole numbers, of numbers enclosed to 2⁻¹²⁸ (docs/atlas.md).
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np

from lockedjoint.formulations.atlas.enclosures import (
    Numbers,
    distance_bound,
    has_full_rank,
    is_definite,
    norm_bound,
    off_by,
    rational,
)
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.exact_numbers import NumberField, has_one_root, records
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.bounds.closed_form import root_below
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray

# An exact Jacobian is this close to that of the file, in the Frobenius norm.
_NEAR = Fraction(1, 10**7)
# No other root of the polynomial is within this of the decimal number on record.
_ISOLATED = Fraction(1, 10**15)
_REFUSED = "the exact value is not proved: {}."


def prove_exact_value(
    asked: Entry,
    jacobian: FloatArray,
    maximum: LocalMaximum | None,
    record: Mapping[str, Any] | None = None,
) -> bool:
    """Prove what is on record of an entry with this Jacobian, or raise CertificateError.

    Return whether the exact Jacobian is proved to be a strict local maximum: as the one that
    `maximum` says is there, or to first order.
    """
    record = records()[asked.name] if record is None else record
    try:
        near = Fraction(record["near"])
        _require(has_one_root(record["polynomial"], near, _ISOLATED), "σ² is no root")
        if record["proof"] == "numerical":
            return False
        exact = _ExactOptimum(asked, record)
        exact.check_equations(record["polynomial"])
        _require(off_by(exact.square, near) < _ISOLATED, "t is another root")
        exact.check_least()
        distance = exact.check_near(jacobian)
        if record["proof"] == "attained":
            return False
        if maximum is not None:
            exact.check_identity(jacobian, distance, maximum)
        else:
            _require(exact.is_sharp(), "no local maximum is proved to be there")
    except (ArithmeticError, IndexError, KeyError, TypeError, ValueError) as error:
        raise CertificateError(f"the exact value is not as it is written: {error}.") from None
    return True


class _ExactOptimum:
    """The numbers on record."""

    def __init__(self, asked: Entry, record: Mapping[str, Any]) -> None:
        _require(asked.model in ("free", "free-mean"), "the columns are not free")
        field = NumberField.of(record["field"], *map(Fraction, record["root"]))
        pool = np.array([field.number(one) for one in record["numbers"]], dtype=object)
        names = "metric", "inverse", "columns", "weights", "vectors", "multipliers"
        places = [np.array(record[name], dtype=int) for name in names]
        m, n = asked.task_dimension, asked.joints
        self.sets = [tuple(one) for one in record["sets"]]
        size = len(self.sets)
        shapes = [(m, m), (m, m), (m, n), (n,), (size, m), (size,)]
        _require([one.shape for one in places] == shapes, "matrices have other shapes")
        known = set(combinations(range(n), asked.locked))
        _require(
            len(set(self.sets)) == size and known.issuperset(self.sets), "sets are unknown"
        )
        numbers = [pool[one] for one in places]
        self.metric, self.inverse, self.columns, self.weights = numbers[:4]
        self.vectors, self.multipliers = numbers[4:]
        self.asked, self.square = asked, pool[0]
        self.one = field.number([1] + [0] * (len(field.polynomial) - 2) + [1])
        self.zero = self.one - self.one
        # w_f x_f x_fᵀ, v_F·x_f and S x_f.
        self.products = self.weights * self.columns[:, None] * self.columns
        self.pulled = self.vectors @ self.columns
        self.covered = self.metric @ self.columns

    def left(self, joints: tuple[int, ...]) -> Numbers:
        """Return M_F."""
        kept = np.delete(self.products, list(joints), axis=2)
        return np.asarray(kept.sum(axis=2) - self.inverse * self.square)

    def check_equations(self, polynomial: Sequence[int]) -> None:
        """Require all equations of an optimum, exactly."""
        root = self.zero
        for c in reversed(polynomial):
            root = root * self.square + self.one.times(c)
        _require_zero(root, "t is no root of the polynomial")
        m, n = self.columns.shape
        product = self.metric @ self.inverse
        product[np.diag_indices(m)] -= self.one
        _require_zero(product, "a matrix is not the inverse of the other")
        _require_zero(self.metric - self.metric.T, "a matrix is not symmetric")
        gradient = np.full((m, n), self.zero)
        total = -self.one
        for vector, pull, multiplier, joints in zip(
            self.vectors, self.pulled, self.multipliers, self.sets, strict=True
        ):
            _require_zero(self.left(joints) @ vector, "t is no eigenvalue")
            part = vector[:, None] * pull * multiplier
            part[:, list(joints)] = self.zero
            gradient = gradient + part
            total = total + multiplier * (vector @ self.inverse @ vector)
        _require_zero(total, "the sum of the multipliers is not 1")
        lengths = self.weights * np.sum(self.columns * self.covered, axis=0)
        # Where all columns share a budget, so do their multipliers: λ = Σ λ_f|j_f|²/n.
        scale = self.weights * np.sum(self.columns * gradient, axis=0)
        if self.asked.model == "free":
            _require_zero(lengths - np.full(n, self.one), "a column is not of length 1")
            rest = gradient - scale * self.covered
        else:
            _require_zero(lengths.sum() - self.one.times(n), "‖J‖² is not n")
            rest = gradient * self.one.times(n) - self.covered * scale.sum()
        _require_zero(rest, "the gradient is not zero")

    def check_least(self) -> None:
        """Require that J exists, and that no other eigenvalue of an A_F is as small as t.

        A_F − tI has the inertia of M_F, and is singular along u_F.
        """
        _require(is_definite(self.metric), "there is no frame")
        _require(all(one.sign > 0 for one in self.weights), "a column has no length")
        for joints in combinations(range(len(self.weights)), self.asked.locked):
            left = self.left(joints)
            if joints in self.sets:
                vector = self.vectors[self.sets.index(joints)]
                _require(any(one.sign for one in vector), "an eigenvector is zero")
                left = left + vector[:, None] * vector
            _require(is_definite(left), "another eigenvalue is as small")

    def check_near(self, jacobian: FloatArray) -> Fraction:
        """Return how far from a Jacobian the exact one is at most, in the nearest frame.

        By lemma 5.4 of Tu and others (arXiv:1507.03566), from Gram matrices, as σ_m(J)² ≥ t.
        """
        factors = self.columns.T @ self.covered
        scales = np.outer(self.weights, self.weights)
        given = rational(jacobian).T @ rational(jacobian)
        self.signs = _signs(factors.astype(float) * given.astype(float))
        given = given * np.outer(self.signs, self.signs)
        off = distance_bound(given.ravel(), factors.ravel(), scales.ravel())
        level, unsure = self.square.enclosed()
        # 2(√2 − 1) > 0.828.
        distance = off / root_below(Fraction(828, 1000) * (level - unsure))
        _require(distance < _NEAR, "another Jacobian is on record")
        return distance

    def is_sharp(self) -> bool:
        """Whether only a change of frame keeps the eigenvalues with multipliers above zero.

        As Σ c_F dλ_F = 0 along the model, one of these falls in every other direction then.
        With dj_f = ±√w_f B y_f the rows are what is to be zero, on the y_f.
        """
        m, n = self.columns.shape
        lengths = self.weights * self.covered
        rows = [lengths]
        if self.asked.model == "free":
            rows = [np.full((m, n), self.zero) for _ in range(n)]
            for f, row in enumerate(rows):
                row[:, f] = lengths[:, f]
        for index in self.active():
            row = self.vectors[index][:, None] * (self.weights * self.pulled[index])
            row[:, list(self.sets[index])] = self.zero
            rows.append(row)
        # Changes of frame are S⁻¹Kx_f, K skew, and keep all of these.
        for a, b in combinations(range(m), 2):
            turned = self.inverse[:, [a]] * self.columns[b]
            rows.append(turned - self.inverse[:, [b]] * self.columns[a])
        return has_full_rank(np.reshape(np.array(rows), (-1, m * n)))

    def check_identity(
        self, jacobian: FloatArray, distance: Fraction, maximum: LocalMaximum
    ) -> None:
        """Require that this is the only solution near a Jacobian of the first-order conditions.

        In the frame nearest to the Jacobian it meets them, with p_F = √c_F u_F and w = −2λ.
        """
        places = {self.sets[index]: index for index in self.active()}
        tied = [tuple(np.flatnonzero(row == 0).tolist()) for row in maximum.kept]
        _require(sorted(tied) == sorted(places), "other sets are tied")
        solved = rational(maximum.jacobian)
        moved = distance + norm_bound(solved - rational(jacobian))
        off, scale = Fraction(0), np.full(len(self.weights), self.zero)
        for joints, root in zip(tied, maximum.roots, strict=True):
            index = places[joints]
            pull, squares = self.pulled[index], self.weights * self.multipliers[index]
            given = (rational(root) @ solved) * self.signs
            # p of both signs are solutions.
            side = 1 if given.astype(float) @ pull.astype(float) >= 0 else -1
            off = max(off, distance_bound(given * side, pull, squares))
            kept = [f for f in range(len(given)) if f not in joints]
            scale[kept] = scale[kept] + squares[kept] * pull[kept] * pull[kept]
        shared = len(scale) if self.asked.model == "free-mean" else 1
        scale = np.array([scale.sum()]) if shared > 1 else scale
        level, unsure = self.square.enclosed()
        # As |p_F| ≤ 1, and the singular values of both J are at most `moved` apart.
        least = root_below(level - unsure) - moved
        farthest = [moved, (off + moved) / least, off_by(self.square, Fraction(maximum.level))]
        for one, weight in zip(scale, rational(maximum.weights), strict=True):
            farthest.append(off_by(one, -shared * weight / 2) * 2 / shared)
        farthest += [abs(one) for one in rational(maximum.turns)]
        _require(
            least > 0 and max(farthest) < Fraction(maximum.uniqueness),
            "it is another local maximum",
        )

    def active(self) -> list[int]:
        """Return the places of the sets whose multipliers are not zero."""
        signs = [one.sign for one in self.multipliers]
        _require(min(signs) >= 0, "a multiplier is negative")
        return [index for index, sign in enumerate(signs) if sign]


def _require(condition: bool | np.bool_, why: str) -> None:
    if not condition:
        raise CertificateError(_REFUSED.format(why))


def _require_zero(numbers: Any, why: str) -> None:
    _require(not np.asarray(numbers, dtype=object).astype(bool).any(), why)


def _signs(agreement: FloatArray) -> FloatArray:
    """Return signs s with s_i s_j those of the entries, along a tree of the largest ones."""
    signs, size = np.zeros(len(agreement), dtype=int), np.abs(agreement)
    signs[0] = 1
    while not signs.all():
        known, other = signs != 0, signs == 0
        i, j = np.unravel_index(np.argmax(size * np.outer(known, other)), size.shape)
        j = j if other[j] else np.flatnonzero(other)[0]
        signs[j] = signs[i] * (1 if agreement[i, j] >= 0 else -1)
    return signs
