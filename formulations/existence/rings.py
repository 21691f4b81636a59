"""Optimally failure-tolerant Jacobians of n revolute joints in closed form: n = 6, all n ≥ 8.

With m = n/2, a² = 1/3 for even n, and m = (n − 3)/2, a² = (n − 9)/(6m) for odd n, put
b² = (1 − a²)/2 and

    v = (√2 b, 0, a),    ω = (−a/√2, 1/√2, b).

The joints are (v; ω) and (v; −ω), each turned about the third axis by all multiples of 2π/m;
for odd n also (e_3; e_1), turned by the multiples of 2π/3. The proof is docs/existence.md,
section 2. A certificate has the exact columns of 8 to 13 joints; six joints more are one copy
more of the isotropic 6R (section 3 there).
"""

from fractions import Fraction
from itertools import chain
from typing import TypeAlias

import numpy as np

from formulations.existence.exact_jacobian import MOST_JOINTS, ExactJacobian
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError

# A number as a sum of terms: a coefficient times roots, which are named here.
_Number: TypeAlias = list[tuple[Fraction, tuple[str, ...]]]
_ALLOWED = (
    "8 or more: six joints or fewer lose a direction of motion with any joint that locks, and "
    "for seven it is proved that there is none"
)
# Columns that are computed with at all.
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
    """
    if not isinstance(joints, int | np.integer) or joints < 8:
        raise InputError("joints", joints, _ALLOWED)
    whole_number("joints", joints, 8, _MOST_COLUMNS)
    m, along = _ring(joints)
    a, b = float(along) ** 0.5, float((1 - along) / 2) ** 0.5
    v, w = np.array([2**0.5 * b, 0, a]), np.array([-a / 2**0.5, 0.5**0.5, b])
    columns = [np.hstack([_turned(v, m), sign * _turned(w, m)]) for sign in (1, -1)]
    if joints % 2:
        third = _turned(np.array([1.0, 0, 0]), 3)
        columns.append(np.hstack([np.tile([0.0, 0, 1], (3, 1)), third]))
    return np.vstack(columns).T


def exact_jacobian(joints: int) -> ExactJacobian:
    """Return the certificate that so many revolute joints have an optimal Jacobian.

    Raises
    ------
    InputError
        If there are fewer than eight joints, or more than `MOST_JOINTS`.
    """
    if not 8 <= joints <= MOST_JOINTS:
        raise InputError("joints", joints, _WRITTEN if joints > MOST_JOINTS else _ALLOWED)
    arms, beyond = divmod(joints - 8, 6)
    m, along = _ring(8 + beyond)
    half, one = Fraction(1, 2), Fraction(1)
    under: dict[str, _Number] = {
        "√2": [(Fraction(2), ())],
        "A": [(along / 2, ())],  # A = a/√2
        "B": [(1 - along, ())],  # B = √2 b
        "√3": [(Fraction(3), ())],
        "√5": [(Fraction(5), ())],
        "sin 72°": [(Fraction(5, 8), ()), (Fraction(1, 8), ("√5",))],
    }
    columns: list[list[_Number]] = []
    for sign in (1, -1):
        for cos, sin in _TURNS[m]:
            v = [_times(cos, one, "B"), _times(sin, one, "B"), _rational(one, "√2", "A")]
            w = [
                _times(cos, -one, "A") + _times(sin, -half, "√2"),
                _times(sin, -one, "A") + _times(cos, half, "√2"),
                _rational(half, "√2", "B"),
            ]
            columns.append([*v, *(_times(entry, Fraction(sign)) for entry in w)])
    if beyond % 2:
        columns += [[[], [], _rational(one), cos, sin, []] for cos, sin in _TURNS[3]]
    if not along:
        columns = [[_without_a(entry) for entry in column] for column in columns]
    used = {name for entry in chain(*columns) for _, roots in entry for name in roots}
    names = [name for name in under if name in used]

    def plain(number: _Number) -> tuple[tuple[Fraction, tuple[int, ...]], ...]:
        return tuple((x, tuple(sorted(names.index(name) for name in r))) for x, r in number)

    roots = tuple(plain(under[name]) for name in names)
    exact = (tuple(plain(entry) for entry in column) for column in columns)
    return ExactJacobian(joints, arms, roots, tuple(exact))


def _ring(joints: int) -> tuple[int, Fraction]:
    """Return the number m of joints in each large ring, and a²."""
    if joints % 2:
        m = (joints - 3) // 2
        return m, Fraction(joints - 9, 6 * m)
    return joints // 2, Fraction(1, 3)


def _turned(vector: FloatArray, m: int) -> FloatArray:
    """Return the vector turned about the third axis by all multiples of 2π/m, one a row."""
    angles = 2 * np.pi * np.arange(m) / m
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, z = vector
    return np.column_stack([cos * x - sin * y, sin * x + cos * y, np.full(m, z)])


def _times(number: _Number, factor: Fraction, *roots: str) -> _Number:
    return [(factor * coefficient, (*own, *roots)) for coefficient, own in number]


def _without_a(number: _Number) -> _Number:
    return [(coefficient, roots) for coefficient, roots in number if "A" not in roots]


def _rational(value: Fraction | int, *roots: str) -> _Number:
    return [(Fraction(value), roots)] if value else []


def _turns() -> dict[int, list[tuple[_Number, _Number]]]:
    """Return cosine and sine of the multiples of 2π/m, for the m that 8 to 13 joints need."""
    half, quarter = Fraction(1, 2), Fraction(1, 4)
    sixths = [
        (_rational(cos * half), _rational(sin * half, "√3"))
        for cos, sin in ((2, 0), (1, 1), (-1, 1), (-2, 0), (-1, -1), (1, -1))
    ]
    quarters = [
        (_rational(cos), _rational(sin)) for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    cos_1 = _rational(-quarter) + _rational(quarter, "√5")
    cos_2 = _rational(-quarter) + _rational(-quarter, "√5")
    sin_1 = _rational(1, "sin 72°")
    sin_2 = _times(cos_1, Fraction(2), "sin 72°")  # sin 144° = 2 sin 72° cos 72°
    fifths = [
        (_rational(1), _rational(0)),
        *((cos_1, sin_1), (cos_2, sin_2)),
        *((cos_2, _times(sin_2, Fraction(-1))), (cos_1, _times(sin_1, Fraction(-1)))),
    ]
    return {3: sixths[::2], 4: quarters, 5: fifths, 6: sixths}


_TURNS = _turns()
