"""A two-point bound proved from its multipliers, with all rounding bounded.

The derivation is in docs/several_failures.md, "Two joints locked: a two-point bound". Nothing
here has a unit. With M = JJᵀ and t the square of the worst case:

- G = Jᵀ(M − tI)⁻¹J, shape (n, n), is the Gram matrix of the scaled columns (M − tI)^(-1/2)J.
  A bound on its trace is one on t;
- d and e: squared lengths G_ii and G_jj of two scaled columns, from 0 to 1;
- x: cosine of the angle between their lines, and s = x². Two locked joints leave a worst case
  of t only if s ≤ (1 − d)(1 − e)/(de);
- K(d, e, x) = Σ_l φ(d)ᵀ F_l φ(e) P_l(x): the kernel. φ(d) are the Chebyshev polynomials of
  2d − 1, P_l is the zonal polynomial of degree 2l, and the `blocks` F_l are symmetric and
  positive definite. The sum of K over all pairs of columns is at least 0;
- h(d): a polynomial, the part of the bound on K that each column has. The `lift` is its
  coefficients in the same Chebyshev polynomials;
- v, the `violation`: K ≤ h(d) + h(e) + v is proved for all pairs that are allowed;
- A: K(d, d, 1) + 2(n − 1)h(d) + d ≤ A is proved for all d. It follows that
  tr G ≤ n(A + (n − 1)v), the `trace_limit` τ.

As a function of (d, e, s) the first condition is one on a polynomial, because only even powers
of x occur. Three maps of the unit cube cover all that is allowed: `few`, `one_large` and
`both_large`. On the cube the polynomials are bounded by `unit_cube`.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from lockedjoint.formulations.bounds.unit_cube import nowhere_positive
from lockedjoint.formulations.existence.certificate import CertificateError


@dataclass(frozen=True)
class TwoPointBound:
    """What the multipliers prove for any columns."""

    #: m, the number of rows of J.
    task_dimension: int
    #: n, the number of its columns.
    joints: int
    #: τ, which tr G is not above.
    trace_limit: float
    #: v, by which K may be above h(d) + h(e); already paid for in τ.
    violation: float
    #: F_0, F_1, …, shape (zonal polynomials, Chebyshev polynomials, Chebyshev polynomials).
    blocks: list[list[list[float]]]
    #: Coefficients of h, of Chebyshev polynomials of 2d − 1, those of low degree first.
    lift: list[float]

    @property
    def singular_value_bound(self) -> float:
        """The bound on the worst case after two locked joints, for ‖J‖_F² = `joints`.

        It is the root of t ≤ (n/m)(1 − m/τ).
        """
        m, limit = self.task_dimension, self.trace_limit
        return sqrt(self.joints / m * max(1.0 - m / limit, 0.0))

    def is_proved(self) -> bool:
        """Whether the multipliers prove it, with all rounding bounded."""
        try:
            prove_two_point(**asdict(self))
        except CertificateError:
            return False
        return True

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as in the record."""
        return {
            **asdict(self),
            "singular_value_bound": self.singular_value_bound,
            "kind": "rigorous",
            "command": "lockedjoint bound two-point "
            f"--task-dimension {self.task_dimension} --joints {self.joints}",
        }


def prove_two_point(
    task_dimension: int,
    joints: int,
    blocks: Sequence[Sequence[Sequence[float]]],
    lift: Sequence[float],
    violation: float,
    trace_limit: float,
) -> None:
    """Prove that tr G ≤ `trace_limit` = n(A + (n − 1)v), or raise CertificateError.

    Arguments are the fields of `TwoPointBound`. They are doubles, and used as exact fractions.
    The proof needs F_l ⪰ 0, the condition with A, and K ≤ h(d) + h(e) + v on all three maps.
    """
    multipliers = _Multipliers(
        task_dimension=task_dimension,
        blocks=[np.array(block, dtype=object) + Fraction(0) for block in blocks],
        lift=[Fraction(value) for value in lift],
        violation=Fraction(violation),
    )
    for block in multipliers.blocks:
        _require(np.array_equal(block, block.T) and _positive(block), "F_l is not positive")
    degree, power = multipliers.degree, multipliers.power
    limit = Fraction(trace_limit) / joints - (joints - 1) * multipliers.violation
    _require(
        nowhere_positive(multipliers.trace_excess(joints, limit), (degree, 0, 0)),
        "the trace may be larger",
    )
    # Degrees of a map are those in p, q and u. A power of e, or of de, raises the first two.
    raised = (degree + power, degree + power, power)
    excesses = [
        (multipliers.few, (degree, degree, power)),
        (multipliers.one_large, raised),
        (multipliers.both_large, raised),
    ]
    for excess, degrees in excesses:
        _require(nowhere_positive(excess, degrees), "K may be larger than h(d) + h(e) + v")


@dataclass(frozen=True, eq=False)
class _Multipliers:
    """The polynomials that are not to be above 0, from multipliers in fractions.

    A point of the unit cube is (p, q, u). Each of `few`, `one_large` and `both_large` maps it
    to a pair of columns (d, e, s), and returns K − h(d) − h(e) − v there, times what makes it a
    polynomial. Together they cover all pairs that are allowed, but for exchanges of d and e.
    """

    #: m.
    task_dimension: int
    #: F_0, F_1, …: square matrices of fractions, dtype object, all of one size.
    blocks: list[Any]
    #: Coefficients of h.
    lift: list[Fraction]
    #: v.
    violation: Fraction

    @cached_property
    def _pairs(self) -> dict[tuple[Fraction, Fraction], tuple[list[Fraction], Fraction]]:
        """What `_at` has returned: on the cube each pair (d, e) occurs with several s."""
        return {}

    def _at(self, d: Fraction, e: Fraction) -> tuple[list[Fraction], Fraction]:
        """Return φ(d)ᵀ F_l φ(e) for each l, and h(d) + h(e)."""
        known = self._pairs.get((d, e))
        if known is None:
            first, second = (np.array(_chebyshev(z, len(self.blocks[0]))) for z in (d, e))
            terms = [first @ block @ second for block in self.blocks]
            known = self._pairs[d, e] = terms, self.lifted(d) + self.lifted(e)
        return known

    @property
    def power(self) -> int:
        """Degree of K in s: that of the last P_l."""
        return len(self.blocks) - 1

    @property
    def degree(self) -> int:
        """Degree of the excess in p and in q, without the powers of d and e.

        It is that of h, or that of φ(d)ᵀ F_l φ(e), where p occurs in d and in e.
        """
        return max(len(self.lift) - 1, 2 * len(self.blocks[0]) - 2)

    def kernel(self, d: Fraction, e: Fraction, s: Fraction) -> Fraction:
        """Return K at d, e and x² = s."""
        zonal = _zonal(self.task_dimension, s, len(self.blocks))
        terms = zip(zonal, self._at(d, e)[0], strict=True)
        return sum((value * term for value, term in terms), Fraction(0))

    def lifted(self, d: Fraction) -> Fraction:
        """Return h(d)."""
        terms = zip(self.lift, _chebyshev(d, len(self.lift)), strict=True)
        return sum((a * b for a, b in terms), Fraction(0))

    def excess(self, d: Fraction, e: Fraction, s: Fraction) -> Fraction:
        """Return K − h(d) − h(e) − v."""
        return self.kernel(d, e, s) - self._at(d, e)[1] - self.violation

    def few(self, p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        """Cover d + e ≤ 1, where s can have all values from 0 to 1."""
        return self.excess(p, (1 - p) * q, u)

    def one_large(self, p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        """Cover d ≤ ½ and d + e ≥ 1, times a power of e.

        With 1 − e = d(1 − q) the largest s is (1 − d)(1 − q)/e.
        """
        d, e = p / 2, 1 - p / 2 * (1 - q)
        return e**self.power * self.excess(d, e, u * (1 - d) * (1 - q) / e)

    def both_large(self, p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        """Cover d ≥ ½ and e ≥ ½, times a power of de; the largest s is (1 − d)(1 − e)/(de)."""
        d, e = (1 + p) / 2, (1 + q) / 2
        return (d * e) ** self.power * self.excess(d, e, u * (1 - d) * (1 - e) / (d * e))

    def trace_excess(self, joints: int, limit: Fraction) -> Callable[..., Fraction]:
        """Return the function K(d, d, 1) + 2(n − 1)h(d) + d − A of d = p; q and u do not occur.

        `joints` is n and `limit` is A.
        """

        def excess(p: Fraction, *_: Fraction) -> Fraction:
            own = self.kernel(p, p, Fraction(1))
            return own + 2 * (joints - 1) * self.lifted(p) + p - limit

        return excess


def _chebyshev(d: Fraction, count: int) -> list[Fraction]:
    """Return the first `count` Chebyshev polynomials of 2d − 1, from degree 0 on."""
    values = [Fraction(1), 2 * d - 1]
    while len(values) < count:
        values.append(2 * values[1] * values[-1] - values[-2])
    return values[:count]


def _zonal(m: int, s: Fraction, count: int) -> list[Fraction]:
    """Return P_0, …, P_{count − 1} at x² = s: zonal polynomials of even degree 2l.

    They are Gegenbauer polynomials for lines in m dimensions, with the value 1 at x = 1. The
    recurrence runs over all degrees. A polynomial of odd degree is divided by x, so that only s
    occurs.
    """
    values = [Fraction(1), Fraction(1)]
    for k in range(1, 2 * count - 2):
        # The factor x of the recurrence: x · x = s for an odd k, and x divided by x otherwise.
        factor = s if k % 2 else Fraction(1)
        values.append(((2 * k + m - 2) * factor * values[-1] - k * values[-2]) / (k + m - 2))
    return values[::2]


def _positive(matrix: Any) -> bool:
    """Whether all pivots of a symmetric matrix are positive, by elimination in fractions."""
    rest = matrix
    while len(rest):
        if rest[0, 0] <= 0:
            return False
        rest = rest[1:, 1:] - np.outer(rest[1:, 0], rest[0, 1:]) / rest[0, 0]
    return True


def _require(condition: bool, why: str) -> None:
    """Raise CertificateError unless a condition holds."""
    if not condition:
        raise CertificateError(f"the two-point bound is not proved: {why}.")
