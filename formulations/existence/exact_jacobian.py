"""An exact optimally failure-tolerant Jacobian of revolute joints, and its verification.

A certificate holds exact columns (v; ω) and the number of copies of the isotropic 6R that stand
beside them. What is checked, for the given columns and for the 6R alike, c columns each:

    |v_i| = |ω_i| = 1,    v_i · ω_i = 0,    J Jᵀ = (c/3) I.                               (1)

J has six rows, v above ω, and a column for each joint i. A number is a sum of terms, each a
fraction times a product of distinct square roots r_0, r_1, …; the number under a root has
earlier roots only. docs/existence.md, section 3, says how numbers are written. Nothing of
`rings` is shared.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, product
from math import isqrt, prod
from typing import TypeAlias

from lockedjoint.formulations.existence.certificate import require, shown

# The limits below are on what a file may ask for: they keep exact arithmetic short. The
# certificates that `rings` makes need no more.
#
#: The largest number of joints.
MOST_JOINTS = 1000
#: The largest number of columns that are written out.
MOST_COLUMNS = 13
#: The largest number of square roots.
MOST_ROOTS = 6
#: The largest number of terms of an entry.
MOST_TERMS = 4
#: The largest number of terms of a number under a root.
MOST_TERMS_UNDER_A_ROOT = 2
#: The largest numerator or denominator.
LARGEST_INTEGER = 10**12
# Number of binary places of the enclosures of the roots. With fewer a number under a root may
# not be seen to be positive.
_BITS = 96

#: A number as a certificate has it: the coefficient and the roots, by number, of each term.
Number: TypeAlias = tuple[tuple[Fraction, tuple[int, ...]], ...]
#: A number that is computed with: the coefficient of each set of roots, none of them zero.
Value: TypeAlias = dict[frozenset[int], Fraction]

#: The columns of the isotropic 6R.
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
    """Add terms to a total in place; a coefficient that becomes zero is left out."""
    for roots, coefficient in terms.items():
        total[roots] = total.get(roots, Fraction(0)) + coefficient
        if not total[roots]:
            del total[roots]


def _value(number: Number) -> Value:
    """Return a certificate's number as one that is computed with."""
    total: Value = {}
    for coefficient, roots in number:
        _add(total, {frozenset(roots): coefficient})
    return total


def _require_positive(squares: list[Value]) -> None:
    """Raise CertificateError unless the number under each root is positive.

    Roots are enclosed one after the other between fractions, from those before.
    """
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
    """Return the JSON text of a number: a list of terms [coefficient, roots]."""
    terms = (f'["{coefficient}", {list(roots)}]' for coefficient, roots in number)
    return f"[{', '.join(terms)}]"
