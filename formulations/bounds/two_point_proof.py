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
`both_large`. A polynomial is not above its largest Bernstein coefficient on a cube. The first
coefficients follow from values at fractions, exactly; those of halves by averages, with bounded
rounding.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from math import comb, sqrt
from typing import Any

import numpy as np

from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray

# Number of halvings of a cube after which the proof gives up: 25 along each axis.
_DEPTH = 75
# Number of cubes in all after which the proof gives up.
_MOST = 500_000
# Number of cubes that are halved at once, to bound the memory.
_CHUNK = 4096


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
        _nowhere_positive(multipliers.trace_excess(joints, limit), (degree, 0, 0)),
        "the trace may be larger",
    )
    # A power of e, or of de, raises the degrees in p and q.
    raised = (degree + power, degree + power, power)
    excesses = [
        (multipliers.few, (degree, degree, power)),
        (multipliers.one_large, raised),
        (multipliers.both_large, raised),
    ]
    for excess, degrees in excesses:
        _require(_nowhere_positive(excess, degrees), "K may be larger than h(d) + h(e) + v")


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
        first, second = (np.array(_chebyshev(z, len(self.blocks[0]))) for z in (d, e))
        zonal = _zonal(self.task_dimension, s, len(self.blocks))
        terms = zip(zonal, self.blocks, strict=True)
        return sum((value * (first @ block @ second) for value, block in terms), Fraction(0))

    def lifted(self, d: Fraction) -> Fraction:
        """Return h(d)."""
        terms = zip(self.lift, _chebyshev(d, len(self.lift)), strict=True)
        return sum((a * b for a, b in terms), Fraction(0))

    def excess(self, d: Fraction, e: Fraction, s: Fraction) -> Fraction:
        """Return K − h(d) − h(e) − v."""
        return self.kernel(d, e, s) - self.lifted(d) - self.lifted(e) - self.violation

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
        """Return K(d, d, 1) + 2(n − 1)h(d) + d − A at d = p; q and u do not occur."""

        def excess(p: Fraction, *_: Fraction) -> Fraction:
            own = self.kernel(p, p, Fraction(1))
            return own + 2 * (joints - 1) * self.lifted(p) + p - limit

        return excess


def _chebyshev(d: Fraction, count: int) -> list[Fraction]:
    """Return the first Chebyshev polynomials of 2d − 1, from degree 0 on."""
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


def _nowhere_positive(function: Callable[..., Fraction], degrees: tuple[int, ...]) -> bool:
    """Whether a polynomial of these degrees is proved not to be above 0 on the unit cube.

    A cube needs no more halving if none of its Bernstein coefficients is above 0. Coefficients
    at the corners are values: one above 0 refutes the claim. Axes of `cubes` are the cubes that
    wait, then the numbers of the coefficient in p, q and u.
    """
    first = _bernstein(function, degrees)
    # A halving takes at most as many averages as the degree; none is above the largest.
    rounding = (_DEPTH * max(degrees) + 2) * 2.0**-52 * float(np.abs(first).max())
    # Cubes, with the number of halvings that made them.
    waiting = [(first[None], 0)]
    count = 0
    while waiting:
        cubes, depth = waiting.pop()
        count += len(cubes)
        cubes = cubes[cubes.max(axis=(1, 2, 3)) > -rounding]
        # A step of the degree takes the first coefficient and the last one of an axis.
        corners = cubes[:, :: max(degrees[0], 1), :: max(degrees[1], 1), :: max(degrees[2], 1)]
        if depth == _DEPTH or count > _MOST or (corners.size and corners.max() > rounding):
            return False
        for half in _halves(cubes, 1 + depth % 3):
            starts = range(0, len(half), _CHUNK)
            waiting.extend((half[i : i + _CHUNK], depth + 1) for i in starts)
    return True


def _bernstein(function: Callable[..., Fraction], degrees: tuple[int, ...]) -> FloatArray:
    """Return the Bernstein coefficients on the unit cube, from values at fractions.

    The shape is (degree + 1, …) over p, q and u. Values at degree + 1 nodes of each axis
    determine them.
    """
    axes = [[Fraction(i, max(k, 1)) for i in range(k + 1)] for k in degrees]
    values = np.array([function(p, q, u) for p in axes[0] for q in axes[1] for u in axes[2]])
    values = values.reshape([len(axis) for axis in axes])
    for place, (k, nodes) in enumerate(zip(degrees, axes, strict=True)):
        basis = [[comb(k, j) * x**j * (1 - x) ** (k - j) for j in range(k + 1)] for x in nodes]
        solved = np.tensordot(_inverse(np.array(basis, dtype=object)), values, (1, place))
        values = np.moveaxis(solved, 0, place)
    return np.asarray(values, dtype=np.float64)


def _inverse(matrix: Any) -> Any:
    """Invert a matrix of fractions whose leading minors are not zero."""
    rows = np.hstack([matrix, np.eye(len(matrix), dtype=int).astype(object)])
    for k in range(len(rows)):
        rows[k] = rows[k] / rows[k, k]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, k], rows[k])
    return rows[:, len(rows) :]


def _halves(cubes: FloatArray, axis: int) -> Iterator[FloatArray]:
    """Yield the coefficients on both halves of cubes, by de Casteljau's averages.

    Along an axis of degree 0 both halves are the same, and one is enough.
    """
    rest = np.moveaxis(cubes, axis, 0)
    low, high = [rest[0]], [rest[-1]]
    while len(rest) > 1:
        rest = 0.5 * (rest[:-1] + rest[1:])
        low.append(rest[0])
        high.append(rest[-1])
    yield np.moveaxis(np.array(low), 0, axis)
    if len(low) > 1:
        yield np.moveaxis(np.array(high[::-1]), 0, axis)


def _require(condition: bool, why: str) -> None:
    """Raise CertificateError unless a condition holds."""
    if not condition:
        raise CertificateError(f"the two-point bound is not proved: {why}.")
