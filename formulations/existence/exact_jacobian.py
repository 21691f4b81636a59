"""An exact optimally failure-tolerant Jacobian of revolute joints, and its verification.

A certificate holds exact columns (v; ω) and the number of copies of the isotropic 6R that stand
beside them. What is checked, for the given columns and for the 6R alike, c columns each:

    |v_i| = |ω_i| = 1,    v_i · ω_i = 0,    J Jᵀ = (c/3) I.                               (1)

docs/existence.md, section 3, says how numbers are written. Nothing of `rings` is shared.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, product
from math import isqrt, prod
from typing import TypeAlias

from lockedjoint.formulations.existence.certificate import require, shown

# Limits on what a Jacobian may have: they keep exact arithmetic short.
MOST_JOINTS = 1000
MOST_COLUMNS = 13
MOST_ROOTS = 6
MOST_TERMS = 4
MOST_TERMS_UNDER_A_ROOT = 2
LARGEST_INTEGER = 10**12
_BITS = 96  # of the enclosures of the roots

Number: TypeAlias = tuple[tuple[Fraction, tuple[int, ...]], ...]  # coefficient, roots
Value: TypeAlias = dict[frozenset[int], Fraction]  # roots → coefficient, none of them zero

SIX_REVOLUTE = (
    ((0, 1, 0, 1, 0, 0), (0, 0, 1, 0, 1, 0), (1, 0, 0, 0, 0, 1))
    + ((0, -1, 0, 1, 0, 0), (0, 0, -1, 0, 1, 0), (-1, 0, 0, 0, 0, 1))
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ExactJacobian:
    """Exact columns beside copies of the isotropic 6R; well-formed, but not yet verified."""

    #: Number of joints n, the columns and six for each copy.
    joints: int
    #: How many copies of the isotropic 6R stand beside the columns.
    six_joint_arms: int
    #: The numbers under the square roots r_0, r_1, …
    roots: tuple[Number, ...]
    #: The entries of each column, v above ω.
    columns: tuple[tuple[Number, ...], ...]

    def __post_init__(self) -> None:
        within = self.joints in range(7, MOST_JOINTS + 1)
        require(within, f"joints is {self.joints}, not 7 to {MOST_JOINTS}")
        require(self.six_joint_arms >= 0, "six_joint_arms is negative")
        columns = len(self.columns)
        require(0 < columns <= MOST_COLUMNS, f"{columns} columns are not 1 to {MOST_COLUMNS}")
        every = columns + 6 * self.six_joint_arms
        require(every == self.joints, f"the columns are {every}, the joints {self.joints}")
        require(len(self.roots) <= MOST_ROOTS, f"there are more than {MOST_ROOTS} roots")
        for place, number in enumerate(self.roots):
            _require_number(number, place, MOST_TERMS_UNDER_A_ROOT)
        for column in self.columns:
            require(len(column) == 6, f"a column of {len(column)} entries has not six")
            for number in column:
                _require_number(number, len(self.roots), MOST_TERMS)

    def to_json(self) -> str:
        """Return the JSON text, one column a line."""
        roots = ", ".join(_as_json(root) for root in self.roots)
        columns = (", ".join(_as_json(number) for number in column) for column in self.columns)
        lines = ",\n".join(f"  [{column}]" for column in columns)
        return (
            f'{{"joints": {self.joints},\n "six_joint_arms": {self.six_joint_arms},\n'
            f' "roots": [{roots}],\n "columns": [\n{lines}]}}\n'
        )


def verify_existence(certificate: ExactJacobian) -> int:
    """Verify (1), exactly, or raise CertificateError; return the number of equations."""
    squares = [_value(root) for root in certificate.roots]
    _require_positive(squares)
    columns = [[_value(number) for number in column] for column in certificate.columns]
    six = [[_value(((Fraction(x), ()),)) for x in column] for column in SIX_REVOLUTE]
    return _checked(columns, squares) + _checked(six, [])


def _checked(columns: list[list[Value]], squares: list[Value]) -> int:
    """Check (1) and return how many equations that were."""
    one, zero = Fraction(1), Fraction(0)
    equations = []
    for place, (v, w) in enumerate((column[:3], column[3:]) for column in columns):
        equations.append((f"|v|² of column {place}", v, v, one))
        equations.append((f"|ω|² of column {place}", w, w, one))
        equations.append((f"v·ω of column {place}", v, w, zero))
    rows = [list(row) for row in zip(*columns, strict=True)]
    for i, j in combinations_with_replacement(range(6), 2):
        expected = Fraction(len(columns), 3) if i == j else zero
        equations.append((f"entry ({i}, {j}) of J Jᵀ", rows[i], rows[j], expected))
    for name, left, right, expected in equations:
        total: Value = {}
        for x, y in zip(left, right, strict=True):
            _add(total, _product(x, y, squares))
        _add(total, {frozenset(): -expected})
        require(not total, f"{name} is not {expected}")
    return len(equations)


def _product(x: Value, y: Value, squares: list[Value]) -> Value:
    """Multiply; the square of a root is the number under it, which has earlier roots only."""
    total: Value = {}
    for (p, a), (q, b) in product(x.items(), y.items()):
        term: Value = {p ^ q: a * b}
        for root in p & q:
            term = _product(term, squares[root], squares)
        _add(total, term)
    return total


def _add(total: Value, terms: Value) -> None:
    for roots, coefficient in terms.items():
        total[roots] = total.get(roots, Fraction(0)) + coefficient
        if not total[roots]:
            del total[roots]


def _value(number: Number) -> Value:
    total: Value = {}
    for coefficient, roots in number:
        _add(total, {frozenset(roots): coefficient})
    return total


def _require_positive(squares: list[Value]) -> None:
    """Enclose the roots one after the other; each number under a root must be positive."""
    low: list[Fraction] = []
    high: list[Fraction] = []
    for place, square in enumerate(squares):
        least = most = Fraction(0)
        for roots, coefficient in square.items():
            ends = [coefficient * prod(end[root] for root in roots) for end in (low, high)]
            least, most = least + min(ends), most + max(ends)
        require(least > 0, f"the number under root {place} is not shown to be positive")
        low.append(Fraction(isqrt(int(least * 4**_BITS)), 2**_BITS))
        high.append(Fraction(isqrt(int(most * 4**_BITS)) + 1, 2**_BITS))


def _require_number(number: Number, roots: int, most_terms: int) -> None:
    """Refuse a number that is too long or uses other roots than the first ones."""
    terms = len(number)
    require(terms <= most_terms, f"a number of {terms} terms has more than {most_terms}")
    for coefficient, used in number:
        require(isinstance(coefficient, Fraction), f"{shown(coefficient)} is not a Fraction")
        larger = max(abs(coefficient.numerator), coefficient.denominator)
        require(larger <= LARGEST_INTEGER, f"{larger} is larger than {LARGEST_INTEGER}")
        for root in used:
            require(root in range(roots), f"root {root} is not one of the {roots} before")
        require(len(set(used)) == len(used), "a root occurs twice in a term")


def _as_json(number: Number) -> str:
    terms = (f'["{coefficient}", {list(roots)}]' for coefficient, roots in number)
    return f"[{', '.join(terms)}]"
