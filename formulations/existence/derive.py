"""Derive the certificate that no optimally failure-tolerant 7R Jacobian exists.

Two squares, averaged over the joint orders, are divided by the equations; the quotients are the
multipliers (docs/nonexistence.md, sections 3 to 5). Every average of a monomial is rewritten
into a few irreducible ones. The first multiple of an equation with a given leading class, by
number of vertices first, becomes its *rule*; all others, once rewritten, are *relations* among
the few classes without a rule. All is computed in rational arithmetic; no result is stored.

Monomials, polynomials, classes and multiples are those of `equations`. A *permutation* is a
tuple: joint i goes to ``permutation[i]``.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, permutations, product
from math import gcd, lcm, prod
from typing import TypeAlias

from lockedjoint.formulations.existence.certificate import Certificate, Multiplier, Square, Term
from lockedjoint.formulations.existence.equations import (
    ONE,
    Frame,
    Monomial,
    Multiple,
    Polynomial,
    class_sums,
    collected,
    combined,
    hermitian_product,
    solved_for,
    substituted,
)

#: A linear combination of multiples of equations: the factor of each.
Combination: TypeAlias = Mapping[Multiple, Fraction]
#: A polynomial in irreducible classes that the equations make zero, its leading coefficient 1,
#: and the combination of multiples that rewrites to it.
Relation: TypeAlias = tuple[Polynomial, Combination]
Permutation: TypeAlias = tuple[int, ...]

#: The equations of 7R in six task dimensions.
SEVEN_REVOLUTE = Frame(joints=7, task_dimension=6)
#: Largest number of factors W, and of factors conj(W), in a multiple. With 2 there is no proof.
ORDER = 3
#: The Young tableau of shape (3, 3, 1) of the symmetriser that makes the two squares.
TABLEAU = ((0, 1, 2), (3, 4, 5), (6,))


@dataclass(frozen=True)
class Rewriting:
    """The equations of a frame up to an order, ready to divide by. Made by `rewriting`."""

    #: The multiples of equations that serve as rules or in relations, averaged.
    averaged: dict[Multiple, Polynomial]
    #: The multiple of which each reducible class, ascending, is the leading class, and the
    #: equal of that class in irreducible classes.
    rules: dict[Monomial, Multiple]
    rewritten: dict[Monomial, Polynomial]
    #: The relation that eliminates each leading class among the irreducible ones.
    relations: dict[Monomial, Relation]

    @property
    def consistent(self) -> bool:
        """Whether the equations leave the average of 1 free, that is, do not imply 1 = 0."""
        return ONE not in self.relations and ONE not in self.rules

    def divide(self, polynomial: Polynomial) -> tuple[Combination, Polynomial]:
        """Return quotients of averaged multiples, and a remainder in free classes.

        The polynomial is Σ quotient · multiple + remainder. A free class is one that neither a
        rule nor a relation eliminates.
        """
        subtracted, remainder = _eliminated(
            substituted(polynomial, self.rewritten), self.relations
        )
        quotients = combined(subtracted)
        used = [(-value, self.averaged[multiple]) for multiple, value in quotients.items()]
        rest = combined([(1, polynomial), (-1, remainder), *used])
        direct: dict[Multiple, Fraction] = {}
        for graph, multiple in reversed(self.rules.items()):
            if graph in rest:
                direct[multiple] = rest[graph] / self.averaged[multiple][graph]
                rest = combined([(1, rest), (-direct[multiple], self.averaged[multiple])])
        assert not rest, "what the relations leave must vanish by the rules"
        return combined([(1, quotients), (1, direct)]), remainder


def rewriting(frame: Frame, order: int) -> Rewriting:
    """Sort the multiples of a frame's equations, up to an order, into rules and relations."""
    each = {multiple: frame.averaged(multiple) for multiple in frame.multiples(order)}
    nonzero = (item for item in each.items() if item[1])
    # Few vertices, edges and terms first keeps the proof short.
    averaged = dict(
        sorted(nonzero, key=lambda item: (*_size(_leading(item[1]))[:2], len(item[1])))
    )
    first: dict[Monomial, Multiple] = {}
    for multiple, polynomial in averaged.items():
        first.setdefault(_leading(polynomial), multiple)
    rules = {graph: first[graph] for graph in sorted(first, key=_size)}
    rewritten: dict[Monomial, Polynomial] = {}
    for graph, multiple in rules.items():
        rewritten[graph] = substituted(solved_for(graph, averaged[multiple]), rewritten)
    relations: dict[Monomial, Relation] = {}
    for multiple, polynomial in averaged.items():
        subtracted, rest = _eliminated(substituted(polynomial, rewritten), relations)
        if rest:
            scale, own = 1 / rest[_leading(rest)], {multiple: Fraction(1)}
            origin = combined([(scale, own), (-scale, combined(subtracted))])
            relations[_leading(rest)] = combined([(scale, rest)]), origin
    return Rewriting(averaged, rules, rewritten, relations)


def _eliminated(
    polynomial: Polynomial, relations: Mapping[Monomial, Relation]
) -> tuple[list[tuple[Fraction, Combination]], Polynomial]:
    """Subtract relations from a polynomial in irreducible classes, largest class first.

    Return the factor and the combination of multiples of each relation that was subtracted,
    and what is left.
    """
    used: list[tuple[Fraction, Combination]] = []
    remainder = polynomial
    while reachable := remainder.keys() & relations.keys():
        graph = max(reachable, key=_size)
        factor, (relation, origin) = remainder[graph], relations[graph]
        used.append((factor, origin))
        remainder = combined([(1, remainder), (-factor, relation)])
    return used, remainder


def _leading(polynomial: Polynomial) -> Monomial:
    """Return the largest class of a polynomial, by `_size`."""
    return max(polynomial, key=_size)


def _size(graph: Monomial) -> tuple[int, int, Monomial]:
    """Order classes: number of vertices, number of edges, then any fixed order."""
    return len(graph.vertices), graph.degree, graph


def derive() -> Certificate:
    """Return the certificate, found from the equations and the two squares alone."""
    equations = rewriting(SEVEN_REVOLUTE, ORDER)
    squares = squared_polynomials()
    averages = [class_sums(hermitian_product(p, p)) for p in squares]
    weights = _cancelling_weights(*(equations.divide(average)[1] for average in averages))
    total = combined(zip(weights, averages, strict=True))
    quotients, remainder = equations.divide(total)
    return Certificate(
        joints=SEVEN_REVOLUTE.joints,
        constant=-remainder[ONE],
        squares=tuple(
            Square(weight, tuple(Term(c, m.w, m.wbar) for m, c in sorted(square.items())))
            for weight, square in zip(weights, squares, strict=True)
        ),
        multipliers=tuple(
            Multiplier(c, m.kind, m.place, m.monomial.w, m.monomial.wbar)
            for m, c in sorted(quotients.items())
        ),
    )


def squared_polynomials() -> tuple[Polynomial, Polynomial]:
    """Return p₁ and q = 3p₁ + p₂ of type (3,3,1); with a = 2, 3 or 4, a·p₁ + p₂ would do.

    p₁ is the symmetrised W_01 conj(W_01) W_23, p₂ the symmetrised W_01 W_23 conj(W_02).
    """
    p1 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 1),)))
    p2 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 2),)))
    return p1, combined([(3, p1), (1, p2)])


def symmetrised(tableau: Sequence[Permutation], monomial: Monomial) -> Polynomial:
    """Return Σ sign(c) c·r·monomial, divided by the common factor of its coefficients.

    It is the Young symmetriser of a tableau: r runs over the permutations that keep its rows, c
    over those that keep its columns.
    """
    columns = [[row[k] for row in tableau if k < len(row)] for k in range(len(tableau[0]))]
    terms = collected(
        (monomial.relabel(row).relabel(column), Fraction(_sign(column)))
        for row in _stabiliser(tableau)
        for column in _stabiliser(columns)
    )
    content = gcd(*(value.numerator for value in terms.values()))
    return {term: value / content for term, value in sorted(terms.items())}


def _sign(permutation: Permutation) -> int:
    """Return +1 for an even and −1 for an odd permutation."""
    images = range(len(permutation))
    return prod(-1 for i in images for j in range(i) if permutation[j] > permutation[i])


def _stabiliser(blocks: Sequence[Sequence[int]]) -> Iterator[Permutation]:
    """Give all permutations that map every block to itself."""
    joints = tuple(chain(*blocks))
    for images in product(*map(permutations, blocks)):
        moved = dict(zip(joints, chain(*images), strict=True))
        yield tuple(moved[joint] for joint in range(len(joints)))


def _cancelling_weights(p: Polynomial, q: Polynomial) -> tuple[Fraction, Fraction]:
    """Return the smallest whole weights that make two affine functions of τ a constant.

    p and q have the class 1 and one more, τ, which the equations leave free.
    """
    (invariant,) = (p.keys() | q.keys()) - {ONE}
    slopes = p[invariant], q[invariant]
    assert slopes[0] * slopes[1] < 0, "one square bounds the invariant above, one below"
    numerators = [abs(slope) * lcm(*(s.denominator for s in slopes)) for slope in slopes]
    common = gcd(*(numerator.numerator for numerator in numerators))
    return numerators[1] / common, numerators[0] / common
