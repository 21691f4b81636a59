"""Sparse polynomials, and the equations that W satisfies at an isotropic Jacobian.

J (m×n, orthonormal rows, m even) is written as a complex matrix Z = V + iΩ with m/2 rows, and
W = ZᵀZ. With P = JᵀJ the equations are (docs/nonexistence.md, section 2)

    row-sum      W 1 = 0              (n = m + 1 only, where P = I − 11ᵀ/n)
    square       W² = 0
    tight-frame  W conj(W) + conj(W) W − 4P = 0

and W_ii = 0, which every unit revolute joint obeys, is built in unless `diagonal` is kept.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from typing import TypeAlias, TypeVar

from formulations.existence.certificate import Kind
from formulations.existence.graphs import ONE, Monomial, canonical, coloured_graphs

Polynomial: TypeAlias = Mapping[Monomial, Fraction]
Key = TypeVar("Key")

# Number of factors W minus number of factors conj(W) in each equation.
CHARGE: dict[Kind, int] = {"row-sum": 1, "square": 2, "tight-frame": 0}
_INDICES: dict[Kind, int] = {"row-sum": 1, "square": 2, "tight-frame": 2}


def collected(terms: Iterable[tuple[Key, Fraction]]) -> dict[Key, Fraction]:
    """Add up terms and drop those that cancel."""
    total: dict[Key, Fraction] = {}
    for key, coefficient in terms:
        total[key] = total.get(key, Fraction(0)) + coefficient
    return {key: value for key, value in total.items() if value}


def combined(
    parts: Iterable[tuple[Fraction | int, Mapping[Key, Fraction]]],
) -> dict[Key, Fraction]:
    """Return the linear combination Σ factor · part, e.g. of polynomials."""
    return collected(
        (key, factor * value) for factor, part in parts for key, value in part.items()
    )


def solved_for(monomial: Monomial, polynomial: Polynomial) -> Polynomial:
    """Return what a monomial equals where a polynomial that contains it is zero."""
    scale = -1 / polynomial[monomial]
    return {m: scale * value for m, value in polynomial.items() if m != monomial}


def substituted(polynomial: Polynomial, values: Mapping[Monomial, Polynomial]) -> Polynomial:
    """Replace the monomials that have values until none of them is left."""
    while polynomial.keys() & values.keys():
        polynomial = combined(
            (value, values.get(monomial, {monomial: Fraction(1)}))
            for monomial, value in polynomial.items()
        )
    return polynomial


def times(monomial: Monomial, polynomial: Polynomial) -> Polynomial:
    """Return the product of a monomial and a polynomial."""
    return {monomial * other: value for other, value in polynomial.items()}


def hermitian_product(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p · conj(q)."""
    return collected((a * b.conjugate(), x * y) for a, x in p.items() for b, y in q.items())


def class_sums(polynomial: Polynomial) -> Polynomial:
    """Return the average over joint orders and conjugation, as a combination of classes.

    A class stands for the average of its members, hence for the average of each of them.
    """
    return collected((canonical(monomial), value) for monomial, value in polynomial.items())


@dataclass(frozen=True, order=True, slots=True)
class Equation:
    """One scalar equation: its kind and its place, a row ``(i,)`` or an entry ``(i, j)``."""

    kind: Kind
    place: tuple[int, ...]


@dataclass(frozen=True, order=True, slots=True)
class Multiple:
    """A monomial times an equation, which is zero at every solution."""

    equation: Equation
    monomial: Monomial = ONE


@dataclass(frozen=True)
class Frame:
    """The equations of isotropic Jacobians with n equal column norms."""

    joints: int
    #: Number m of rows, even: n − 1 (one degree of redundancy) or n (none).
    task_dimension: int
    #: Keep the diagonal entries W_ii as unknowns, for columns that need not obey W_ii = 0.
    diagonal: bool = False

    @property
    def redundant(self) -> bool:
        """Whether there is a null vector, so that row sums vanish."""
        return self.joints == self.task_dimension + 1

    def projector(self, i: int, j: int) -> Fraction:
        """Return the entry P_ij of the projector JᵀJ."""
        return Fraction(i == j) - (Fraction(1, self.joints) if self.redundant else 0)

    def polynomial(self, equation: Equation) -> Polynomial:
        """Return the left-hand side of an equation."""
        if equation.kind == "row-sum":
            (row,) = equation.place
            return collected((Monomial(((row, j),)), Fraction(1)) for j in self._columns(row))
        i, j = equation.place
        paths = [((i, k), (k, j)) for k in self._columns(i, j)]
        if equation.kind == "square":
            return collected((Monomial(path), Fraction(1)) for path in paths)
        products = [Monomial((a,), (b,)) for a, b in paths]
        terms = [(term, Fraction(1)) for m in products for term in (m, m.conjugate())]
        return collected([*terms, (ONE, -4 * self.projector(i, j))])

    def averaged(self, multiple: Multiple) -> Polynomial:
        """Return a multiple of an equation as a combination of classes."""
        return class_sums(times(multiple.monomial, self.polynomial(multiple.equation)))

    def multiples(self, order: int) -> Iterator[Multiple]:
        """Give all multiples with at most `order` edges of each colour.

        Up to the order of the joints and conjugation every multiple occurs, some repeatedly.
        """
        for kind in self._kinds:
            charge = CHARGE[kind]
            own_wbar = int(kind == "tight-frame")
            for w in range(order - charge - own_wbar + 1):
                for monomial in coloured_graphs(self.joints, w, w + charge, self.diagonal):
                    # Places among the joints used and as many unused ones as can matter.
                    used = len(monomial.vertices)
                    for equation in self._at(kind, used + _INDICES[kind]):
                        yield Multiple(equation, monomial)

    def _columns(self, *rows: int) -> list[int]:
        return [k for k in range(self.joints) if self.diagonal or k not in rows]

    @property
    def _kinds(self) -> list[Kind]:
        return [kind for kind in CHARGE if kind != "row-sum" or self.redundant]

    def _at(self, kind: Kind, joints: int) -> Iterator[Equation]:
        """Give the equations of a kind at places among the first joints."""
        first = range(min(self.joints, joints))
        for place in combinations_with_replacement(first, _INDICES[kind]):
            yield Equation(kind, place)
