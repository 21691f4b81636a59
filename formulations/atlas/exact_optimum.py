"""Optima of free columns in exact numbers: the worst case as a root of a polynomial, proved.

Columns of an exact J are j_f = ±√w_f B x_f, with a frame B that is known by S = BᵀB only, so
that numbers of small fields suffice. With A_F = J_F̄J_F̄ᵀ, t = σ², u_F = B⁻ᵀv_F the conditions

    (Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹) v_F = 0,    Σ_{F∌f} c_F (v_F·x_f) v_F = λ_f S x_f

say that A_F u_F = tu_F and that Σ c_F ∇λ_F is a multiple of the gradient of the model
(docs/atlas.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from math import sqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from formulations.atlas.entry import Entry
from formulations.atlas.exact_numbers import NumberField, has_one_root, records
from formulations.atlas.local_maximum import LocalMaximum
from formulations.atlas.local_optimality import frame_changes, model_conditions
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray

Numbers = npt.NDArray[np.object_]
# An exact Gram matrix differs from that of the file by less, in the Frobenius norm.
_NEAR = 1e-6
# What floating-point arithmetic on numbers of the order of one changes is far below this.
_ROUNDING = 1e-11
# Least singular value of gradients that count as independent.
_INDEPENDENT = 1e-3
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
        _require(has_one_root(record["polynomial"], near, Fraction(1, 10**15)), "σ² is no root")
        if record["proof"] == "numerical":
            return False
        exact = _ExactOptimum(asked, record)
        exact.check_equations(record["polynomial"])
        _require(abs(exact.t - float(near)) < 1e-10, "t is another root")
        distance = exact.distance(jacobian)
        exact.check_least(jacobian, distance)
        if record["proof"] == "attained":
            return False
        if not exact.is_sharp(jacobian, distance):
            if maximum is None:
                raise CertificateError(
                    _REFUSED.format("no local maximum is proved to be there")
                )
            exact.check_identity(jacobian, distance, maximum)
    except (ArithmeticError, IndexError, KeyError, TypeError, ValueError) as error:
        raise CertificateError(f"the exact value is not as it is written: {error}.") from None
    return True


class _ExactOptimum:
    """The numbers on record, exact and in double precision."""

    def __init__(self, asked: Entry, record: Mapping[str, Any]) -> None:
        _require(asked.model in ("free", "free-mean"), "the columns are not free")
        near, width = map(Fraction, record["root"])
        field = NumberField.of(record["field"], near, width)
        pool = np.array([field.number(one) for one in record["numbers"]], dtype=object)
        close = np.array([one.approximate() for one in pool])
        self.asked = asked
        self.one, self.square = (
            field.number([1] + [0] * (len(field.polynomial) - 2) + [1]),
            pool[0],
        )
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
        (
            self.metric,
            self.inverse,
            self.columns,
            self.weights,
            self.vectors,
            self.multipliers,
        ) = (pool[one] for one in places)
        self.floats = dict(zip(names, (close[one] for one in places), strict=True))
        self.t = float(close[0])
        self.kept = np.ones((size, n), dtype=int)
        for row, one in zip(self.kept, self.sets, strict=True):
            row[list(one)] = 0

    def check_equations(self, polynomial: Sequence[int]) -> None:
        """Require all equations of an optimum, exactly."""
        zero = self.one - self.one
        root = zero
        for c in reversed(polynomial):
            root = root * self.square + self.one.times(c)
        _require(not root, "t is no root of the polynomial")
        m, n = self.columns.shape
        left = self.metric @ self.inverse
        left[np.diag_indices(m)] -= self.one
        left = np.append(left, self.metric - self.metric.T)
        _require(not left.astype(bool).any(), "a matrix is not the inverse of the other")
        products = self.weights * self.columns[:, None] * self.columns
        pulled = self.vectors @ self.columns  # of sets and joints
        covered = self.metric @ self.columns
        lengths = self.weights * np.sum(self.columns * covered, axis=0)
        share = np.array([self.one] * n) if self.asked.model == "free" else None
        gradient = np.full((m, n), zero)
        for vector, pull, multiplier, joints in zip(
            self.vectors, pulled, self.multipliers, self.sets, strict=True
        ):
            lost = list(joints)
            rest = products.sum(axis=2) - products[:, :, lost].sum(axis=2)
            off = (rest - self.inverse * self.square) @ vector
            _require(not off.astype(bool).any(), "t is no eigenvalue")
            if multiplier:
                part = vector[:, None] * pull * multiplier
                part[:, lost] = zero
                gradient = gradient + part
        # Where all columns share a budget, so do their multipliers: λ = Σ λ_f|j_f|²/n.
        scale = self.weights * np.sum(self.columns * gradient, axis=0)
        if share is None:
            _require(not (lengths.sum() - self.one.times(n)), "‖J‖² is not n")
            left = gradient * self.one.times(n) - covered * scale.sum()
        else:
            _require(not (lengths - share).astype(bool).any(), "a column is not of length 1")
            left = gradient - scale * covered
        _require(not left.astype(bool).any(), "the gradient is not zero")

    def distance(self, jacobian: FloatArray) -> float:
        """Return how far the nearest frame's exact J is from a Jacobian at most.

        Lemma 5.4 of Tu and others (arXiv:1507.03566): from Gram matrices.
        """
        scaled = self.floats["columns"] * np.sqrt(self.floats["weights"])
        gram, given = scaled.T @ self.floats["metric"] @ scaled, jacobian.T @ jacobian
        signs = self.signs = _signs(gram * given)
        off = float(np.linalg.norm(gram * np.outer(signs, signs) - given)) + _ROUNDING
        _require(off < _NEAR, "another Jacobian is on record")
        least = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
        return off / (sqrt(2 * (sqrt(2) - 1)) * least)

    def check_least(self, jacobian: FloatArray, distance: float) -> None:
        """Require that no other eigenvalue is as small as t."""
        self.gap = np.inf
        change = distance * (2 * float(np.linalg.norm(jacobian)) + distance) + _ROUNDING
        listed = set(self.sets)
        for joints in combinations(range(jacobian.shape[1]), self.asked.locked):
            rest = np.delete(jacobian, list(joints), axis=1)
            values = np.linalg.eigvalsh(rest @ rest.T)
            above = values[1 if joints in listed else 0] - self.t - change
            _require(above > 0, "another eigenvalue is as small")
            if joints in listed:
                self.gap = min(self.gap, above)

    def is_sharp(self, jacobian: FloatArray, distance: float) -> bool:
        """Whether no direction keeps all least eigenvalues that have multipliers above zero.

        As Σ c_F dλ_F = 0 along the model, one of these falls in every direction then.
        """
        rows = [one.gradient(jacobian) for one in model_conditions(self.asked)]
        rows += frame_changes(self.asked, jacobian)
        for kept, multiplier in zip(self.kept, self.floats["multipliers"], strict=True):
            _require(multiplier > -_ROUNDING, "a multiplier is negative")
            if multiplier > _ROUNDING:
                rest = jacobian * kept
                vector = np.linalg.eigh(rest @ rest.T)[1][:, 0]
                rows.append(np.outer(vector, vector @ rest))
        size = float(np.linalg.norm(jacobian)) + distance
        # An eigenvector turns by at most 2‖ΔA‖/gap.
        change = distance * (1 + 8 * size**2 / self.gap) * sqrt(len(rows))
        spread = np.linalg.svd(np.reshape(rows, (-1, jacobian.size)), compute_uv=False)
        full = len(rows) >= jacobian.size and spread[-1] > _INDEPENDENT
        return bool(full and change < 0.5 * _INDEPENDENT)

    def check_identity(
        self, jacobian: FloatArray, distance: float, maximum: LocalMaximum
    ) -> None:
        """Require that this is the only solution near a Jacobian of the first-order conditions.

        In the frame nearest to the Jacobian it meets them, with p_F = √c_F u_F and w = −2λ.
        """
        active = self.floats["multipliers"] > _ROUNDING
        order = np.lexsort(maximum.kept.T)
        kept = self.kept[active]
        mine = np.lexsort(kept.T)
        same = kept.shape == maximum.kept.shape
        _require(
            same and bool(np.all(kept[mine] == maximum.kept[order])), "other sets are tied"
        )
        vectors = self.floats["vectors"][active][mine]
        multipliers = self.floats["multipliers"][active][mine]
        sizes = np.einsum("fi,ij,fj->f", vectors, self.floats["inverse"], vectors)
        multipliers = multipliers / (multipliers @ sizes)
        columns = self.floats["columns"] * np.sqrt(self.floats["weights"]) * self.signs
        pulled = np.sqrt(multipliers)[:, None] * (vectors @ columns)
        roots = maximum.roots[order]
        # p of both signs are solutions.
        given = roots @ maximum.jacobian
        pulled *= np.sign(np.sum(pulled * given, axis=1))[:, None]
        moved = distance + float(np.linalg.norm(maximum.jacobian - jacobian))
        off = np.linalg.norm(pulled - given, axis=1).max() + moved
        least = float(np.linalg.svd(maximum.jacobian, compute_uv=False)[-1])
        scale = np.sum((pulled * kept[mine]) ** 2, axis=0)
        if self.asked.model == "free-mean":
            scale = np.array([scale.mean()])
        farthest = max(
            moved,
            off / least,
            np.abs(maximum.weights + 2 * scale).max(),
            abs(maximum.level - self.t),
            np.abs(maximum.turns).max(),
        )
        _require(farthest + _ROUNDING < maximum.uniqueness, "it is another local maximum")


def _require(condition: bool | np.bool_, why: str) -> None:
    if not condition:
        raise CertificateError(_REFUSED.format(why))


def _signs(agreement: FloatArray) -> FloatArray:
    """Return signs s with s_i s_j those of the entries, along a tree of the largest ones."""
    signs, size = np.zeros(len(agreement)), np.abs(agreement)
    signs[0] = 1.0
    while not signs.all():
        known, other = np.abs(signs) > 0, signs == 0
        i, j = np.unravel_index(np.argmax(size * np.outer(known, other)), size.shape)
        j = j if other[j] else np.flatnonzero(other)[0]
        signs[j] = signs[i] * (1.0 if agreement[i, j] >= 0 else -1.0)
    return signs
