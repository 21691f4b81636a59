"""Optimally failure-tolerant Jacobians of n revolute joints in closed form: n = 6, all n ≥ 8.

J has six rows, v above ω, and a column for each joint. Here m is a number of joints, not of
rows: J is made of two rings of m joints each, and for odd n a third one of three joints.

With m = n/2, a² = 1/3 for even n, and m = (n − 3)/2, a² = (n − 9)/(6m) for odd n, put b² = (1 −
a²)/2, v = (√2 b, 0, a) and ω = (−a/√2, 1/√2, b). The joints are (v; ω) and (v; −ω), each turned
about the third axis by all multiples of 2π/m; for odd n also (e_3; e_1), by 2π/3. The proof is
docs/existence.md, section 2. Certificates have the columns of 8 to 13 joints; six more are a
copy of the isotropic 6R.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.existence.exact_jacobian import MOST_JOINTS, ExactJacobian, Number
from lockedjoint.nlp.arrays import FloatArray, whole_number
from lockedjoint.nlp.errors import InputError

_ALLOWED = (
    "8 or more: six joints or fewer lose a direction of motion with any joint that locks, and "
    "for seven it is proved that there is none"
)
# Largest number of joints of `optimal_jacobian`: more only fill the memory.
_MOST_COLUMNS = 1_000_000
_WRITTEN = f"at most {MOST_JOINTS} in a certificate; docs/existence.md has the proof for all"


def optimal_jacobian(joints: int) -> FloatArray:
    """Return an optimally failure-tolerant Jacobian of unit revolute joints, in closed form.

    Parameters
    ----------
    joints
        Number of joints n, 8 or more.

    Returns
    -------
    FloatArray
        6×n; J Jᵀ = (n/3) I, and every column has |v| = |ω| = 1 and v·ω = 0. Its worst case
        is √((n − 6)/3), the bound (6) of the paper.

    Raises
    ------
    InputError
        If there are fewer than eight joints.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> jacobian = lj.optimal_jacobian(8)
    >>> lj.measures.is_optimally_failure_tolerant(jacobian)
    True
    """
    if not isinstance(joints, int | np.integer) or joints < 8:
        raise InputError("joints", joints, _ALLOWED)
    whole_number("joints", joints, 8, _MOST_COLUMNS)
    m, square = _ring(joints)

    def turns(number: int) -> FloatArray:
        """Return cosines and sines of the multiples of 2π/number, shape (2, number)."""
        angles = 2 * np.pi * np.arange(number) / number
        return np.array([np.cos(angles), np.sin(angles)])

    third = turns(3) if joints % 2 else np.zeros((2, 0))
    lengths = np.sqrt(np.array([2, square / 2, 1 - square], dtype=float))
    return np.asarray(_columns(turns(m), third, *lengths))


def exact_jacobian(joints: int) -> ExactJacobian:
    """Return the certificate that 8 to `MOST_JOINTS` revolute joints have an optimal J."""
    if not 8 <= joints <= MOST_JOINTS:
        raise InputError("joints", joints, _WRITTEN if joints > MOST_JOINTS else _ALLOWED)
    arms, beyond = divmod(joints - 8, 6)
    m, square = _ring(8 + beyond)
    under = {
        "√2": _Sum.of(2),
        "a/√2": _Sum.of(square / 2),
        "√2 b": _Sum.of(1 - square),
        "√3": _Sum.of(3),
        "√5": _Sum.of(5),
        "sin 72°": _Sum.of(Fraction(5, 8)) + _Sum.of(Fraction(1, 8), "√5"),
    }
    lengths = (_Sum.of(1 if under[name].terms else 0, name) for name in ("√2", "a/√2", "√2 b"))
    third = _turns(3) if beyond % 2 else np.zeros((2, 0), dtype=object)
    columns = _columns(_turns(m), third, *lengths).T
    used = {name for entry in columns.flat for _, roots in entry.terms for name in roots}
    names = [name for name in under if name in used]

    def plain(number: _Sum) -> Number:
        """Return a sum with its roots by number, as a certificate has it."""
        return tuple((x, tuple(sorted(map(names.index, roots)))) for x, roots in number.terms)

    roots = tuple(plain(under[name]) for name in names)
    return ExactJacobian(
        joints, arms, roots, tuple(tuple(map(plain, column)) for column in columns)
    )


def _ring(joints: int) -> tuple[int, Fraction]:
    """Return the number m of joints in each large ring, and a²."""
    if joints % 2:
        m = (joints - 3) // 2
        return m, Fraction(joints - 9, 6 * m)
    return joints // 2, Fraction(1, 3)


def _columns(
    turns: npt.NDArray[Any], third: npt.NDArray[Any], root_2: Any, a: Any, b: Any
) -> npt.NDArray[Any]:
    """Return J, shape (6, n), in floating-point numbers or in sums of roots.

    `turns` and `third` have the cosines and sines of the multiples of 2π/m and of 2π/3, shape
    (2, m) and (2, 3), or (2, 0) without the third ring. In the header's letters `root_2` is √2,
    `a` is a/√2 and `b` is √2 b.
    """
    cos, sin = turns
    none = 0 * cos
    v = [cos * b, sin * b, none + root_2 * a]
    w = [
        -1 * cos * a + -0.5 * sin * root_2,
        -1 * sin * a + 0.5 * cos * root_2,
        none + 0.5 * root_2 * b,
    ]
    rings = [np.array([*v, *(sign * entry for entry in w)]) for sign in (1, -1)]
    cos, sin = third
    return np.hstack([*rings, np.array([0 * cos, 0 * cos, 0 * cos + 1, cos, sin, 0 * cos])])


@dataclass(frozen=True)
class _Sum:
    """A sum of terms: a rational coefficient times distinct roots, which are named."""

    terms: tuple[tuple[Fraction, tuple[str, ...]], ...]

    @staticmethod
    def of(value: Fraction | float, *roots: str) -> "_Sum":
        """Return one term; 0 has none."""
        return _Sum(((Fraction(value), roots),) if value else ())

    def __add__(self, other: "_Sum | float") -> "_Sum":
        return _Sum(self.terms + (other if isinstance(other, _Sum) else _Sum.of(other)).terms)

    def __mul__(self, other: "_Sum | Fraction | float") -> "_Sum":
        factor = other if isinstance(other, _Sum) else _Sum.of(other)
        return _Sum(tuple((x * y, p + q) for x, p in self.terms for y, q in factor.terms))

    __rmul__ = __mul__


def _turns(m: int) -> npt.NDArray[Any]:
    """Return cosines and sines of the multiples of 2π/m, m = 3 to 6: shape (2, m)."""
    if m == 5:
        quarter, sin_1 = Fraction(1, 4), _Sum.of(1, "sin 72°")
        cos_1, cos_2 = (_Sum.of(-quarter) + _Sum.of(s * quarter, "√5") for s in (1, -1))
        sin_2 = 2 * cos_1 * sin_1  # sin 144°
        cosines = [_Sum.of(1), cos_1, cos_2, cos_2, cos_1]
        return np.array([cosines, [_Sum.of(0), sin_1, sin_2, -1 * sin_2, -1 * sin_1]])
    half = Fraction(1, 2)
    if m == 4:
        steps, unit = [(2, 0), (0, 2), (-2, 0), (0, -2)], _Sum.of(half)
    else:
        steps = [(2, 0), (1, 1), (-1, 1), (-2, 0), (-1, -1), (1, -1)][:: 6 // m]
        unit = _Sum.of(half, "√3")
    return np.array([[_Sum.of(half * cos), sin * unit] for cos, sin in steps]).T
