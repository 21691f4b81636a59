"""Division by the equations: every average of a monomial in terms of a few irreducible ones.

Classes are ordered by number of vertices first. A multiple of an equation then has a leading
class, in which the equation's free index is a separate vertex, and rewrites it into smaller
ones: W1 = 0 removes a leaf, W² = 0 or the tight-frame equation a vertex of degree two.
The first multiple with a given leading class becomes its *rule*; all others, once rewritten,
are *relations* among the few classes without a rule, a small linear system over the rationals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from formulations.existence.equations import Frame, Multiple, Polynomial, combined
from formulations.existence.graphs import ONE, Monomial

Combination: TypeAlias = Mapping[Multiple, Fraction]


@dataclass(frozen=True)
class Relation:
    """A polynomial in irreducible classes that the equations make zero, and its derivation.

    Parameters
    ----------
    polynomial
        Scaled so that its leading coefficient is 1.
    origin
        The combination of multiples which rewrites to `polynomial`.
    """

    polynomial: Polynomial
    origin: Combination


@dataclass(frozen=True)
class Rewriting:
    """The equations of a frame up to an order, ready to divide by. Made by `rewriting`.

    Parameters
    ----------
    averaged
        The multiples of equations that serve as rules or in relations, averaged.
    rules
        For each reducible class, ascending, the multiple of which it is the leading class.
    rewritten
        For each reducible class, its equal in irreducible classes.
    relations
        For each leading class among the irreducible ones, the relation that eliminates it.
    """

    averaged: dict[Multiple, Polynomial]
    rules: dict[Monomial, Multiple]
    rewritten: dict[Monomial, Polynomial]
    relations: dict[Monomial, Relation]

    @property
    def consistent(self) -> bool:
        """Whether the equations leave the average of 1 free, that is, do not imply 1 = 0."""
        return ONE not in self.relations and ONE not in self.rules

    def divide(self, polynomial: Polynomial) -> tuple[Combination, Polynomial]:
        """Split a combination of classes into multiples of the equations and a remainder.

        Returns
        -------
        quotients, remainder
            ``polynomial = Σ quotient · averaged multiple + remainder``, where the remainder
            holds only classes that no equation reaches: 1 and the free moments.
        """
        quotients, remainder = _eliminated(_rewrite(polynomial, self.rewritten), self.relations)
        used = [(-value, self.averaged[multiple]) for multiple, value in quotients.items()]
        rest = combined([(Fraction(1), polynomial), (Fraction(-1), remainder), *used])
        total = dict(quotients)
        for graph, multiple in reversed(self.rules.items()):
            if graph in rest:
                factor = rest[graph] / self.averaged[multiple][graph]
                total[multiple] = total.get(multiple, Fraction(0)) + factor
                rest = combined([(Fraction(1), rest), (-factor, self.averaged[multiple])])
        assert not rest, "what the relations leave must vanish by the rules"
        return {multiple: value for multiple, value in total.items() if value}, remainder


def rewriting(frame: Frame, order: int) -> Rewriting:
    """Sort the multiples of a frame's equations, up to an order, into rules and relations."""
    averaged = _simplest_first(frame, order)
    first: dict[Monomial, Multiple] = {}
    for multiple, polynomial in averaged.items():
        first.setdefault(leading(polynomial), multiple)
    rules = {graph: first[graph] for graph in sorted(first, key=size)}
    rewritten: dict[Monomial, Polynomial] = {}
    for graph, multiple in rules.items():
        rule = averaged[multiple]
        equal = {other: -value / rule[graph] for other, value in rule.items() if other != graph}
        rewritten[graph] = _rewrite(equal, rewritten)
    relations: dict[Monomial, Relation] = {}
    for multiple, polynomial in averaged.items():
        relation = _relation(multiple, _rewrite(polynomial, rewritten), relations)
        if relation.polynomial:
            relations[leading(relation.polynomial)] = relation
    return Rewriting(averaged, rules, rewritten, relations)


def _simplest_first(frame: Frame, order: int) -> dict[Multiple, Polynomial]:
    """Average all multiples; few vertices, edges and terms first keeps the proof short."""
    averaged = {multiple: frame.averaged(multiple) for multiple in frame.multiples(order)}

    def complexity(item: tuple[Multiple, Polynomial]) -> tuple[int, int, int]:
        vertices, degree, _ = size(leading(item[1]))
        return vertices, degree, len(item[1])

    return dict(sorted(((m, p) for m, p in averaged.items() if p), key=complexity))


def _rewrite(polynomial: Polynomial, rewritten: Mapping[Monomial, Polynomial]) -> Polynomial:
    """Apply rules, given by what they make of each class, until none applies."""
    return combined(
        (value, rewritten.get(graph, {graph: Fraction(1)}))
        for graph, value in polynomial.items()
    )


def _relation(
    multiple: Multiple, polynomial: Polynomial, known: Mapping[Monomial, Relation]
) -> Relation:
    """Return what of a rewritten multiple does not follow from the relations already known."""
    quotients, remainder = _eliminated(polynomial, known)
    scale = 1 / remainder[leading(remainder)] if remainder else Fraction(1)
    origin = {used: -scale * value for used, value in quotients.items()}
    return Relation(
        {graph: scale * value for graph, value in remainder.items()},
        {**origin, multiple: scale},
    )


def _eliminated(
    polynomial: Polynomial, relations: Mapping[Monomial, Relation]
) -> tuple[Combination, Polynomial]:
    """Subtract relations from a polynomial in irreducible classes, largest class first."""
    quotients: dict[Multiple, Fraction] = {}
    remainder = polynomial
    while reachable := remainder.keys() & relations.keys():
        graph = max(reachable, key=size)
        factor, relation = remainder[graph], relations[graph]
        remainder = combined([(Fraction(1), remainder), (-factor, relation.polynomial)])
        for multiple, value in relation.origin.items():
            quotients[multiple] = quotients.get(multiple, Fraction(0)) + factor * value
    return {multiple: value for multiple, value in quotients.items() if value}, remainder


def leading(polynomial: Polynomial) -> Monomial:
    """Return the largest class of a polynomial."""
    return max(polynomial, key=size)


def size(graph: Monomial) -> tuple[int, int, Monomial]:
    """Order classes: number of vertices, number of edges, then any fixed order."""
    return len(graph.vertices), graph.degree, graph
