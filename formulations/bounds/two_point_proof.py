"""A two-point bound proved from its multipliers, with all rounding bounded.

With s = x² the condition K(d, e, x) ≤ h(d) + h(e) + v is on a polynomial in (d, e, s). Three
maps of the unit cube cover all that is allowed (docs/several_failures.md). A polynomial is not
above its largest Bernstein coefficient on a cube. The first coefficients follow from values at
fractions, exactly; those of halves by averages, with bounded rounding.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from math import comb, sqrt
from typing import Any

import numpy as np

from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray

# Number of halvings of a cube after which the proof gives up.
_DEPTH = 75
# Number of cubes in all after which the proof gives up.
_MOST = 500_000
# Number of cubes that are halved at once.
_CHUNK = 4096


@dataclass(frozen=True)
class TwoPointBound:
    """What the multipliers prove for any columns."""

    #: m and n.
    task_dimension: int
    joints: int
    #: τ, which tr G is not above.
    trace_limit: float
    #: What K may be above h + h by; already paid for in τ.
    violation: float
    #: F_l, and the coefficients of h.
    blocks: list[list[list[float]]]
    lift: list[float]

    @property
    def singular_value_bound(self) -> float:
        """The bound on the worst case after two locked joints, for ‖J‖_F² = `joints`."""
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

    `blocks` are the symmetric F_l and `lift` the coefficients of h, of Chebyshev polynomials of
    2d − 1; `violation` v is what K may be above h(d) + h(e) by.
    """
    n, v = joints, Fraction(violation)
    exact = [np.array(block, dtype=object) + Fraction(0) for block in blocks]
    heights = [Fraction(value) for value in lift]
    limit = Fraction(trace_limit) / n - (n - 1) * v
    for block in exact:
        _require(np.array_equal(block, block.T) and _positive(block), "F_l is not positive")

    def kernel(d: Fraction, e: Fraction, s: Fraction) -> Fraction:
        first, second = (np.array(_chebyshev(z, len(exact[0]))) for z in (d, e))
        zonal = _zonal(task_dimension, s, len(exact))
        parts = zip(zonal, exact, strict=True)
        return sum((z * (first @ block @ second) for z, block in parts), Fraction(0))

    def lifted(d: Fraction) -> Fraction:
        terms = zip(heights, _chebyshev(d, len(heights)), strict=True)
        return sum((a * b for a, b in terms), Fraction(0))

    def excess(d: Fraction, e: Fraction, s: Fraction) -> Fraction:
        return kernel(d, e, s) - lifted(d) - lifted(e) - v

    def few(p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        return excess(p, (1 - p) * q, u)

    def one_large(p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        d, e = p / 2, 1 - p / 2 * (1 - q)
        return e**power * excess(d, e, u * (1 - d) * (1 - q) / e)

    def both_large(p: Fraction, q: Fraction, u: Fraction) -> Fraction:
        d, e = (1 + p) / 2, (1 + q) / 2
        return (d * e) ** power * excess(d, e, u * (1 - d) * (1 - e) / (d * e))

    def alone(p: Fraction, *_: Fraction) -> Fraction:
        return kernel(p, p, Fraction(1)) + 2 * (n - 1) * lifted(p) + p - limit

    power, degree = len(exact) - 1, max(len(heights) - 1, 2 * len(exact[0]) - 2)
    whole = (degree + power, degree + power, power)
    _require(_nowhere_positive(alone, (degree, 0, 0)), "the trace may be larger")
    for one, degrees in (
        (few, (degree, degree, power)),
        (one_large, whole),
        (both_large, whole),
    ):
        _require(_nowhere_positive(one, degrees), "K may be larger than h(d) + h(e) + v")


def _chebyshev(d: Fraction, count: int) -> list[Fraction]:
    values = [Fraction(1), 2 * d - 1]
    while len(values) < count:
        values.append(2 * values[1] * values[-1] - values[-2])
    return values[:count]


def _zonal(m: int, s: Fraction, count: int) -> list[Fraction]:
    """Return the zonal polynomials of even degree at x² = s; those of odd degree are over x."""
    values = [Fraction(1), Fraction(1)]
    for k in range(1, 2 * count - 2):
        x = s if k % 2 else Fraction(1)
        values.append(((2 * k + m - 2) * x * values[-1] - k * values[-2]) / (k + m - 2))
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
    """Whether a polynomial of these degrees is proved not to be above 0 on the unit cube."""
    first = _bernstein(function, degrees)
    # A halving takes at most as many averages as the degree; none is above the largest.
    rounding = (_DEPTH * max(degrees) + 2) * 2.0**-52 * float(np.abs(first).max())
    waiting, count = [(first[None], 0)], 0
    while waiting:
        cubes, depth = waiting.pop()
        count += len(cubes)
        cubes = cubes[cubes.max(axis=(1, 2, 3)) > -rounding]
        corners = cubes[:, :: max(degrees[0], 1), :: max(degrees[1], 1), :: max(degrees[2], 1)]
        if depth == _DEPTH or count > _MOST or (corners.size and corners.max() > rounding):
            return False
        for half in _halves(cubes, 1 + depth % 3):
            starts = range(0, len(half), _CHUNK)
            waiting.extend((half[i : i + _CHUNK], depth + 1) for i in starts)
    return True


def _bernstein(function: Callable[..., Fraction], degrees: tuple[int, ...]) -> FloatArray:
    """Return the Bernstein coefficients on the unit cube, from values at fractions."""
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
    """Yield the coefficients on both halves of cubes, by de Casteljau's averages."""
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
    if not condition:
        raise CertificateError(f"the two-point bound is not proved: {why}.")
