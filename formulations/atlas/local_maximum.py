"""An isolated entry proved to be a local maximum, with all rounding errors bounded.

Let A_F = J_F̄J_F̄ᵀ, S some of the sets F at the worst case √t, and p_F = √y_F u_F with
eigenvectors u_F at t and multipliers y_F. The first-order conditions are that the gradient is
zero of

    G = t(1 − Σ|p_F|²) + Σ p_FᵀA_F p_F + Σ w_k h_k(J) − Σ μ_l ⟨g_l, J − J⁰⟩,    F in S,

h_k = 0 the equations of the model, and of isotropy where it is asked for, g_l the changes of J⁰
with frame and phase. A contraction shows a zero; the inertia of D²G there, by Gershgorin's
discs, shows a strict maximum (docs/atlas_proofs.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, nextafter, sqrt
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import nnls

from lockedjoint.formulations import isotropy, max_min
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.local_optimality import (
    Condition,
    frame_changes,
    isotropic_conditions,
    model_conditions,
    null_space,
    worst_failures,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray

_NEWTON_STEPS = 8
_LARGEST = 100.0  # of an unknown on the way
# How many choices of sets are tried.
_CHOICES = 4
# The bound β is for balls of at most this radius.
_RADIUS = 1e-4
# Entries that differ by more are another Jacobian.
_NEAR = 1e-5
# Multipliers below this count as zero.
_INACTIVE = 1e-7
# Sums of up to a million positive doubles.
_SAFETY = 1 + 1e-9
_REFUSED = "not proved to be a strict local maximum: {}."

_exact = np.frompyfunc(Fraction, 1, 1)


@dataclass(frozen=True, eq=False)
class LocalMaximum:
    """What was proved of a worst case."""

    #: Number of sets of joints in the proof.
    sets: int
    #: What no worst case near the Jacobian is above.
    sigma: float
    #: The true unknowns are not farther than this from the solution in double precision.
    distance: float
    #: Nothing else this near meets the first-order conditions, frame and phase fixed.
    uniqueness: float
    #: The solution in double precision: J, p_F, w, t and μ.
    jacobian: FloatArray
    roots: FloatArray
    weights: FloatArray
    level: float
    turns: FloatArray
    #: The joints that are left are 1 in the row of each p_F.
    kept: FloatArray


def prove_local_maximum(
    asked: Entry, jacobian: FloatArray, sets: Sequence[tuple[int, ...]] | None = None
) -> LocalMaximum:
    """Prove that a strict local maximum is next to a Jacobian, or raise CertificateError.

    First by these sets of joints, if any are given: others may do as well, and which of them
    rounding would choose depends on the machine.
    """
    treated = asked.formulation in (max_min.NAME, isotropy.NAME)
    _require(treated, f"its formulation is {asked.formulation}")
    for choice in (*([] if sets is None else [sets]), *range(_CHOICES)):
        try:
            return _proved(asked, Conditions(asked, jacobian, choice))
        except CertificateError as error:
            refused = error
        except np.linalg.LinAlgError:
            refused = CertificateError(_REFUSED.format("derivatives are singular"))
    raise refused


def _proved(asked: Entry, conditions: Conditions) -> LocalMaximum:
    x = conditions.solution()
    (m, n), size = conditions.fixed.shape, len(x)
    slope, inverse = conditions.slope(x), np.linalg.inv(conditions.slope(x))
    weight = np.abs(inverse)
    # More than what rounding changes in D²G(x⁰), and in a product with it.
    small = size * 2.0**-51
    bound, wide = conditions.majorant(x, 0.0), conditions.majorant(x, _RADIUS)
    delta = _norm(inverse @ slope - np.eye(size)) + _norm(weight @ (small * bound))
    # Convex in the radius, so that smaller balls have less than their share.
    growth = (wide - bound + small * wide) / _RADIUS
    distance = 2 * _norm(weight @ np.abs(conditions.gradient(x))[:, None])
    uniqueness = min(_RADIUS, (0.5 - delta) / (_SAFETY * _norm(weight @ growth)))
    _require(distance < uniqueness, "no solution is proved to be near")
    found, p, w, t, mu = conditions.parts(x)
    moved = np.abs(found - conditions.fixed).max()
    _require(moved < _NEAR, "the solution found is another Jacobian")
    change = _SAFETY * (_norm(growth) * distance + _norm(small * bound))
    for index, one in enumerate(p):
        place = slice(m * (n + index), m * (n + index + 1))
        shifted = 0.5 * slope[place, place] + np.outer(one, one)
        least = _inertia(shifted, change + 3 * m * distance) == (m, 0)
        _require(least, "an eigenvalue is not the simple least")
        _require(np.abs(one).max() > distance, "a multiplier is zero")
    limited = w[[one.limit for one in conditions.model]]
    _require(np.all(limited < -distance), "a limit of the model is not attained")
    turned = np.reshape(frame_changes(asked, found), (-1, m * n))
    fixed = conditions.frames.reshape(-1, m * n)
    gram = _inertia(fixed @ turned.T, len(fixed) * _norm(fixed) * distance)
    _require(gram == (len(fixed), 0), "frame and phase are not fixed")
    positive = m * len(p) + len(w) + len(fixed)
    _require(_inertia(slope, change) == (positive, m * n + 1), "it is no strict maximum")
    sigma = nextafter(sqrt(t + distance), inf)
    return LocalMaximum(
        len(p), sigma, distance, uniqueness, found, p, w, float(t), mu, conditions.kept
    )


class Conditions:
    """The derivatives of G, for one choice of the sets S."""

    def __init__(
        self, asked: Entry, jacobian: FloatArray, choice: int | Sequence[tuple[int, ...]]
    ) -> None:
        self.fixed = jacobian
        self.model = [*model_conditions(asked)]
        if asked.formulation == isotropy.NAME:
            self.model += independent(self.model, isotropic_conditions(asked))
        self.frames = np.array(frame_changes(asked, jacobian))
        failures = worst_failures(jacobian, asked.failures)
        if not isinstance(choice, int):
            lost = [tuple(np.flatnonzero(one.kept == 0).tolist()) for one in failures]
            failures = [one for one, own in zip(failures, lost, strict=True) if own in choice]
            _require(len(failures) == len(choice), "a set is not at the worst case")
            choice = 0
        simple = all(one.active.shape[1] == 1 for one in failures)
        _require(simple, "a least eigenvalue is not simple")
        # Multipliers of independent gradients, after those of the model are taken off.
        normals = [one.gradient(jacobian) for one in self.model]
        pulls = [2 * one.active @ (one.active.T @ one.rest) for one in failures]
        tangents = null_space(normals)
        columns = np.array([np.append(tangents @ pull.ravel(), 1.0) for pull in pulls]).T
        y = self.multipliers(columns, choice)
        chosen = y > _INACTIVE
        self.kept = np.array([one.kept for one in failures])[chosen]
        roots = [np.sqrt(v) * one.active[:, 0] for v, one in zip(y, failures, strict=True)]
        self.roots = np.array(roots)[chosen]
        pull = np.tensordot(y, pulls, axes=1).ravel()
        self.weights = -np.linalg.lstsq(np.reshape(normals, (-1, pull.size)).T, pull)[0]

    def multipliers(self, columns: FloatArray, choice: int) -> FloatArray:
        """Return with which multipliers these columns, one of each set, add up to (0, …, 1)."""
        # Other scales lead to other ones if they are not unique.
        drawn = np.random.default_rng(choice).standard_normal(len(columns.T))
        scale = np.exp(3 * drawn) if choice else np.ones_like(drawn)
        return np.asarray(scale * nnls(columns * scale, np.eye(len(columns))[-1])[0])

    def parts(self, x: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Return J, p, w, t and μ."""
        sizes = (self.fixed.size, self.roots.size, len(self.weights), 1)
        j, p, w, t, mu = np.split(x, np.cumsum(sizes))
        return j.reshape(self.fixed.shape), p.reshape(self.roots.shape), w, t[0], mu

    def solution(self) -> FloatArray:
        """Return the unknowns in double precision, by Newton's method."""
        rest = self.fixed * self.kept[0]
        t = np.linalg.eigvalsh(rest @ rest.T)[0]
        none = np.zeros(len(self.frames))
        parts: list[Any] = [self.fixed.ravel(), self.roots.ravel(), self.weights, [t], none]
        x: FloatArray = np.concatenate(parts)
        for _ in range(_NEWTON_STEPS):
            _require(np.abs(x).max() < _LARGEST, "no solution is found")
            x = x - np.linalg.lstsq(self.slope(x), self.gradient(x))[0]
        return x

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return the gradient of G, exact but for the last rounding."""
        return np.asarray(self.gradient_in(_exact, x).astype(float))

    def gradient_in(self, number: Any, x: Any) -> Any:
        """Return it in the numbers of an elementwise function that makes them."""
        j, p, w, t, mu = self.parts(number(x))
        levels = number(np.array([one.level for one in self.model]))
        linear = number(np.array([one.linear for one in self.model]))
        frames, kept = number(self.frames), number(self.kept)
        normals = linear.copy()
        for row, one in zip(normals, self.model, strict=True):
            places, others = np.nonzero(one.form)  # at most one in a row, a whole number
            row[places] = row[places] + number(one.form[places, others]) * j.ravel()[others]
        rest = j * kept[:, None]
        pulled = np.sum(p[:, :, None] * rest, axis=1)
        by_j = 2 * p.T @ pulled + (w @ normals).reshape(j.shape)
        by_j = by_j - np.sum(mu[:, None, None] * frames, axis=0)
        by_p = 2 * (np.sum(rest * pulled[:, None], axis=2) - t * p)
        by_w = (normals + linear) @ j.ravel() / 2 - levels
        by_mu = -np.sum(frames * (j - number(self.fixed)), axis=(1, 2))
        return np.concatenate([by_j.ravel(), by_p.ravel(), by_w, [1 - np.sum(p * p)], by_mu])

    def slope(self, x: FloatArray) -> FloatArray:
        """Return the second derivatives of G."""
        j, p, w, t, _ = self.parts(x)
        m, n = j.shape
        rest = j * self.kept[:, None]
        pulled = np.einsum("fi,fin->fn", p, rest)
        bent = np.einsum("fi,fk,fn,nl->inkl", p, p, self.kept, np.eye(n)).reshape(m * n, -1)
        by_j = 2 * bent + np.tensordot(w, [one.form for one in self.model], axes=1)
        crossed = np.einsum("ai,fn->fain", np.eye(m), pulled)
        crossed = 2 * (crossed + np.einsum("fan,fi->fain", rest, p)).reshape(p.size, -1)
        by_p = block_diag(*(2 * (one @ one.T - t * np.eye(m)) for one in rest))
        normals = [one.gradient(j).ravel() for one in self.model]
        lower = np.vstack([*normals, 0 * j.ravel(), *-self.frames.reshape(-1, m * n)])
        ties = np.zeros((len(lower), p.size))
        ties[len(normals)] = -2 * p.ravel()
        upper = np.block([[by_j, crossed.T], [crossed, by_p]])
        beside = np.hstack([lower, ties])
        none = np.zeros((len(lower), len(lower)))
        return np.block([[upper, beside.T], [beside, none]])

    def majorant(self, x: FloatArray, radius: float) -> FloatArray:
        """Return what no second derivative is above in absolute value, at most `radius` away.

        Terms of an entry have one sign where all unknowns are positive, but t is negative.
        """
        large = np.abs(x) + radius
        large[-1 - len(self.frames)] *= -1
        return np.abs(self.slope(large))


def independent(known: Sequence[Condition], more: Iterable[Condition]) -> list[Condition]:
    """Return those of more conditions that do not follow from the others, exactly."""
    kept, new = list(known), list[Condition]()
    for one in more:
        rows = np.array([[*each.form.ravel(), *each.linear, each.level] for each in kept])
        own = np.array([*one.form.ravel(), *one.linear, one.level])
        shares = np.round(np.linalg.lstsq(rows.T, own)[0])
        if np.any(shares @ rows != own):
            kept.append(one)
            new.append(one)
    return new


def _inertia(matrix: FloatArray, change: float) -> tuple[int, int] | None:
    """Return how many eigenvalues are positive and negative, None if that is not proved.

    Of all matrices with rows and columns at most `change` off in the sum of absolute values.
    """
    v = np.linalg.eigh(matrix)[1]
    size = np.abs(v)
    product = v.T @ matrix @ v
    centres = np.diag(product)
    rounding = len(v) * 2.0**-51 * size.T @ np.abs(matrix) @ size
    widths = np.sum(np.abs(product - np.diag(centres)) + rounding, axis=1)
    clear = np.abs(centres) > _SAFETY * (widths + _norm(size.T) * _norm(size) * change)
    return (int(np.sum(centres > 0)), int(np.sum(centres < 0))) if clear.all() else None


def _norm(matrix: FloatArray) -> float:
    """Return the largest sum of absolute values in a row."""
    return _SAFETY * float(np.abs(matrix).sum(axis=1).max())


def _require(condition: bool | np.bool_, why: str) -> None:
    if not condition:
        raise CertificateError(_REFUSED.format(why))
