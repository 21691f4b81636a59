"""An isolated entry proved to be a local maximum, with all rounding errors bounded.

J is the Jacobian, shape (m, n), and J⁰ the one of the entry's file. F is a set of joints that
lock, J_F̄ is J with zeros in their columns, A_F = J_F̄J_F̄ᵀ, and √t the worst case: t is the
least eigenvalue of all A_F. S are some of the sets F at the worst case, |S| of them, with unit
eigenvectors u_F of A_F at t, multipliers y_F > 0 of sum 1, and p_F = √y_F u_F. The first-order
conditions are that the gradient is zero of

    G = t(1 − Σ|p_F|²) + Σ p_FᵀA_F p_F + Σ w_k h_k(J) − Σ μ_l ⟨g_l, J − J⁰⟩,    F in S,

where h_k = 0 are the equations of the model (`Condition`), and of isotropy where it is asked
for, w_k their multipliers, g_l the changes of J⁰ with frame and phase, shape (m, n), and μ_l
theirs. x are all unknowns, one after another: J row after row, the p_F, w, t and μ, N numbers
(`Unknowns`).

A contraction shows that the gradient has a zero near a solution x⁰ in double precision; the
inertia there of D²G, the second derivatives of G, shows a strict maximum: the numbers of its
positive and negative eigenvalues, by Gershgorin's discs (docs/atlas_proofs.md). Distances of x
are in the maximum norm, norms of matrices are the largest sum of absolute values in a row.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, nextafter, sqrt
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
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

# Largest number of Newton steps to x⁰. They start from a file with 1e-9 or better; more do no
# harm.
_NEWTON_STEPS = 8
# A Newton step that changes no unknown by more than this is the last. A larger one ends farther
# from the solution, and the proof may fail.
_LAST_STEP = 1e-15
# An unknown on the way that is larger shows that the steps lead nowhere.
_LARGEST_UNKNOWN = 100.0
# Number of choices of multipliers, and so of the sets S, that are tried where none are given.
_CHOICES = 4
# Standard deviation of the logarithm of the scales that lead from one choice to another.
_SCALE_SPREAD = 3
# Largest radius of the balls around x⁰ in which second derivatives are bounded. In a larger
# ball the bound is larger, and the contraction may fail; in a smaller one fewer solutions are
# near.
_RADIUS = 1e-4
# A Jacobian with an entry farther than this from that of the file is another one.
_NEAR = 1e-5
# Multipliers y_F below this count as zero: the set is left out.
_INACTIVE = 1e-7
# The true value of a sum of up to a million positive doubles is below this times the computed
# one.
_SAFETY = 1 + 1e-9
# Rounding changes a sum of N products of doubles by at most N times this, relative to the sum
# of their absolute values. (Half a unit of the last place is 2⁻⁵³.)
_ROUNDING = 2.0**-51
_REFUSED = "not proved to be a strict local maximum: {}."


@dataclass(frozen=True, eq=False)
class LocalMaximum:
    """What was proved of a worst case.

    Attributes
    ----------
    sets
        Number |S| of sets of joints in the proof.
    sigma
        What no worst case near the Jacobian is above.
    distance
        The true unknowns are not farther than this from the solution x⁰ in double precision.
    uniqueness
        Nothing else this near meets the first-order conditions, frame and phase fixed.
    jacobian, roots, weights, level, turns
        The solution x⁰: J, shape (m, n), p_F, shape (|S|, m), w, t and μ.
    kept
        For each p_F a row of shape (n,): 1 for joints that are left, 0 for those in F.
    """

    sets: int
    sigma: float
    distance: float
    uniqueness: float
    jacobian: FloatArray
    roots: FloatArray
    weights: FloatArray
    level: float
    turns: FloatArray
    kept: FloatArray


class Unknowns(NamedTuple):
    """The unknowns x by name: arrays of doubles, of fractions or of other numbers."""

    jacobian: Any  # J, shape (m, n)
    roots: Any  # p_F, shape (|S|, m)
    weights: Any  # w, one for each condition of the model
    level: Any  # t, a number
    turns: Any  # μ, one for each change of frame or phase


class _SparseCondition(NamedTuple):
    """A condition of the model at the entries of J, row after row, that it depends on."""

    places: npt.NDArray[np.intp]  # the numbers of these entries
    linear: FloatArray  # ℓ there
    factors: FloatArray  # the entry of H that is not zero in each of these rows, or 0
    partners: npt.NDArray[np.intp]  # the number of its column
    level: float  # c


def _unit_exponent(*parts: npt.ArrayLike) -> int:
    """Return e ≥ 0 for which all these doubles are whole multiples of 2⁻ᵉ."""
    numbers = np.concatenate([np.ravel(part) for part in parts])
    return max(0, 53 - int(np.frexp(numbers[numbers != 0])[1].min(initial=53)))


def _in_units(numbers: npt.ArrayLike, exponent: int) -> Any:
    """Return doubles as whole numbers of 2⁻ᵉ, an array of integers of any length."""
    ratios = [float(number).as_integer_ratio() for number in np.ravel(numbers)]
    whole = np.array([a * ((1 << exponent) // b) for a, b in ratios], dtype=object)
    return whole.reshape(np.shape(numbers))


def prove_local_maximum(
    asked: Entry, jacobian: FloatArray, sets: Sequence[tuple[int, ...]] | None = None
) -> LocalMaximum:
    """Prove that a strict local maximum is next to a Jacobian J⁰, or raise CertificateError.

    `sets` are the sets S of the proof, joints counted from 0. They are tried first, if any are
    given: others may do as well, and which of them rounding would choose depends on the
    machine.
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


class _Zero(NamedTuple):
    """A zero of the gradient of G that is proved to be near x⁰."""

    x: FloatArray  # x⁰, shape (N,)
    slope: FloatArray  # D²G(x⁰) as computed, shape (N, N)
    distance: float  # the zero is not farther than this from x⁰
    uniqueness: float  # it is the only one that is not farther than this
    change: float  # D²G at the zero differs from `slope` by a matrix of at most this norm


def _proved_zero(conditions: Conditions) -> _Zero:
    """Prove by a contraction that the gradient of G has a zero near x⁰.

    With C the inverse of D²G(x⁰), ‖I − C D²G(x)‖ ≤ δ + βr within r of x⁰, so that
    x − C∇G(x) contracts by ½ where δ + βr ≤ ½, and takes the ball of radius
    2|C∇G(x⁰)| into itself.
    """
    x = conditions.solution()
    slope = conditions.slope(x)
    inverse = np.linalg.inv(slope)
    weight = np.abs(inverse)
    # More than what rounding changes in D²G(x⁰), and in a product with it, relative to `bound`.
    small = len(x) * _ROUNDING
    bound, wide = conditions.majorant(x, 0.0), conditions.majorant(x, _RADIUS)
    delta = _norm(inverse @ slope - np.eye(len(x))) + _norm(weight @ (small * bound))
    # D²G changes by at most `growth` · r within r of x⁰, entry by entry: the majorant is convex
    # in the radius, so that smaller balls have less than their share.
    growth = (wide - bound + small * wide) / _RADIUS
    distance = 2 * _norm(weight @ np.abs(conditions.gradient(x))[:, None])
    uniqueness = min(_RADIUS, (0.5 - delta) / (_SAFETY * _norm(weight @ growth)))
    _require(distance < uniqueness, "no solution is proved to be near")
    change = _SAFETY * (_norm(growth) * distance + _norm(small * bound))
    return _Zero(x, slope, distance, uniqueness, change)


def _proved(asked: Entry, conditions: Conditions) -> LocalMaximum:
    """Prove that there is a zero of the gradient, and that it is a strict local maximum."""
    m, n = conditions.fixed.shape
    x, slope, distance, uniqueness, change = _proved_zero(conditions)
    found, p, w, t, mu = conditions.parts(x)
    moved = np.abs(found - conditions.fixed).max()
    _require(moved < _NEAR, "the solution found is another Jacobian")
    for index, one in enumerate(p):
        # The block of D²G that belongs to p_F is 2(A_F − tI). A_F − tI + p_F p_Fᵀ is positive
        # definite exactly if t is the least eigenvalue, and simple. |p_F| ≤ 1, so that a row of
        # p_F p_Fᵀ changes by at most 3m · distance.
        place = slice(m * (n + index), m * (n + index + 1))
        shifted = 0.5 * slope[place, place] + np.outer(one, one)
        least = _inertia(shifted, change + 3 * m * distance) == (m, 0)
        _require(least, "an eigenvalue is not the simple least")
        _require(np.abs(one).max() > distance, "a multiplier is zero")
    limited = w[[one.limit for one in conditions.model]]
    _require(np.all(limited < -distance), "a limit of the model is not attained")
    # The inner products ⟨g_l, changes of the found J⟩ are a regular matrix, so that μ = 0. The
    # changes have entries of J, which are off by `distance` at most.
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
    """The derivatives of G, for one choice of the sets S.

    `choice` has the sets S, or is a number: 0 for the multipliers that non-negative least
    squares find, 1, 2, … for others, if these are not unique. Raises CertificateError if it
    cannot be.

    Attributes
    ----------
    fixed
        J⁰, shape (m, n).
    model
        The conditions h_k, those of isotropy last.
    frames
        The changes g_l of J⁰, shape (changes, m, n).
    kept
        For each set F in S a row of shape (n,): 1 for joints that are left, 0 for those in F.
    roots, weights
        p_F, shape (|S|, m), and w, from which Newton's method starts.
    """

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
        # Multipliers y_F with Σ y_F ∇λ_F = 0 along the model, and Σ y_F = 1. The gradient of
        # the least eigenvalue λ_F of A_F is 2 u_F u_Fᵀ J_F̄.
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
        """Return multipliers ≥ 0 with which columns, one of each set, add up to (0, …, 0, 1).

        The last entry of each column is 1: the multipliers add up to 1. If they are not unique,
        another `choice` scales the columns at random, and finds others.
        """
        drawn = np.random.default_rng(choice).standard_normal(len(columns.T))
        scale = np.exp(_SCALE_SPREAD * drawn) if choice else np.ones_like(drawn)
        return np.asarray(scale * nnls(columns * scale, np.eye(len(columns))[-1])[0])

    def parts(self, x: Any) -> Unknowns:
        """Return the unknowns by name; views of the vector x, shape (N,)."""
        sizes = (self.fixed.size, self.roots.size, len(self.weights), 1)
        j, p, w, t, mu = np.split(x, np.cumsum(sizes))
        return Unknowns(j.reshape(self.fixed.shape), p.reshape(self.roots.shape), w, t[0], mu)

    def solution(self) -> FloatArray:
        """Return the unknowns x⁰ in double precision, shape (N,), by Newton's method."""
        rest = self.fixed * self.kept[0]
        t = np.linalg.eigvalsh(rest @ rest.T)[0]
        mu = np.zeros(len(self.frames))
        parts: list[Any] = [self.fixed.ravel(), self.roots.ravel(), self.weights, [t], mu]
        x: FloatArray = np.concatenate(parts)
        for _ in range(_NEWTON_STEPS):
            _require(np.abs(x).max() < _LARGEST_UNKNOWN, "no solution is found")
            step = np.linalg.lstsq(self.slope(x), self.gradient(x))[0]
            x = x - step
            if np.abs(step).max() <= _LAST_STEP:
                break
        return x

    @cached_property
    def _sparse_model(self) -> list[_SparseCondition]:
        """The conditions of the model, without entries that are zero."""
        found = []
        for one in self.model:
            rows, others = np.nonzero(one.form)  # at most one in a row
            places = np.union1d(np.flatnonzero(one.linear), rows)
            factors, partners = np.zeros(len(places)), np.zeros(len(places), dtype=int)
            own = np.searchsorted(places, rows)
            factors[own], partners[own] = one.form[rows, others], others
            found.append(
                _SparseCondition(places, one.linear[places], factors, partners, one.level)
            )
        return found

    def gradient(self, x: FloatArray) -> FloatArray:
        """Return the gradient of G, shape (N,), exact but for the last rounding.

        All doubles are whole multiples of one power of 2, the unit. Products of two and of
        three are whole multiples of its square and its cube: this is arithmetic of integers.
        """
        model, frames = self._sparse_model, self.frames.reshape(len(self.frames), -1)
        constants = [part for one in model for part in (one.linear, one.factors, one.level)]
        unit = _unit_exponent(x, frames, self.fixed, *constants)
        j, p, w, t, mu = self.parts(_in_units(x, unit))
        flat, moved = j.ravel(), j.ravel() - _in_units(self.fixed, unit).ravel()
        # A number of units is one of squared units if it is shifted once, and so on.
        once, twice = 1 << unit, 1 << 2 * unit
        rest = np.where(self.kept[:, None], j, 0)
        pulled = np.sum(p[:, :, None] * rest, axis=1)  # J_F̄ᵀp_F, shape (|S|, n)
        by_j = (2 * p.T @ pulled).ravel()
        by_p = 2 * (np.sum(rest * pulled[:, None], axis=2) - once * t * p)
        by_w, by_mu = [], []
        for weight, one in zip(w, model, strict=True):
            linear = once * _in_units(one.linear, unit)
            # ∇h_k = Hj + ℓ, and twice h_k = ½ jᵀHj + ℓ·j − c.
            normal = linear + _in_units(one.factors, unit) * flat[one.partners]
            by_j[one.places] += weight * normal
            level = 2 * twice * _in_units(one.level, unit)[()]
            by_w.append(np.sum((normal + linear) * flat[one.places]) - level)
        for factor, frame in zip(mu, frames, strict=True):
            places = np.flatnonzero(frame)
            entries = _in_units(frame[places], unit)
            by_j[places] -= once * factor * entries
            by_mu.append(-once * np.sum(entries * moved[places]))
        by_t = once * (twice - np.sum(p * p))
        by_weights, by_turns = (np.array(one, dtype=object) for one in (by_w, by_mu))
        parts = (2 * by_j, 2 * by_p.ravel(), by_weights, [2 * by_t], 2 * by_turns)
        # A quotient of integers is rounded once.
        return np.asarray(np.concatenate(parts) / (2 * once * twice), dtype=float)

    def slope(self, x: FloatArray) -> FloatArray:
        """Return the second derivatives of G, shape (N, N), in double precision."""
        j, p, w, t, _ = self.parts(x)
        m, n = j.shape
        rest = j * self.kept[:, None]  # J_F̄ of each set, shape (|S|, m, n)
        pulled = np.einsum("fi,fin->fn", p, rest)  # J_F̄ᵀp_F, shape (|S|, n)
        bent = np.einsum("fi,fk,fn,nl->inkl", p, p, self.kept, np.eye(n)).reshape(m * n, -1)
        # Blocks by J and J, by p and J, by p and p; then the rows of w, t and μ.
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
        """Return what no second derivative is above in absolute value within `radius` of x.

        Shape (N, N). The terms of an entry of D²G have one sign where all unknowns are positive
        and t is negative, so that no terms cancel there.
        """
        large = np.abs(x) + radius
        large[-1 - len(self.frames)] *= -1  # t
        return np.abs(self.slope(large))


def independent(known: Sequence[Condition], more: Iterable[Condition]) -> list[Condition]:
    """Return those of `more` conditions that do not follow from the others, exactly.

    A condition follows if it is a sum of others, with whole numbers as factors.
    """
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

    It holds for all symmetric matrices that differ by at most `change`, in the sum of absolute
    values of a row. VᵀMV, V the eigenvectors in double precision, is nearly diagonal and has
    the inertia of M (Sylvester); its Gershgorin discs must not meet 0.
    """
    v = np.linalg.eigh(matrix)[1]
    size = np.abs(v)
    product = v.T @ matrix @ v
    centres = np.diag(product)
    rounding = len(v) * _ROUNDING * size.T @ np.abs(matrix) @ size
    widths = np.sum(np.abs(product - np.diag(centres)) + rounding, axis=1)
    clear = np.abs(centres) > _SAFETY * (widths + _norm(size.T) * _norm(size) * change)
    return (int(np.sum(centres > 0)), int(np.sum(centres < 0))) if clear.all() else None


def _norm(matrix: FloatArray) -> float:
    """Return the largest sum of absolute values in a row."""
    return _SAFETY * float(np.abs(matrix).sum(axis=1).max())


def _require(condition: bool | np.bool_, why: str) -> None:
    """Raise CertificateError with this reason unless a condition holds."""
    if not condition:
        raise CertificateError(_REFUSED.format(why))
