"""Division by the equations: every average of a monomial in terms of a few irreducible ones.

Classes are ordered by number of vertices first. A multiple of an equation then has a leading
class, in which the equation's free index is a separate vertex, and rewrites it into smaller
ones: W1 = 0 removes a leaf, W² = 0 or the tight-frame equation a vertex of degree two.
The first multiple with a given leading class becomes its *rule*; all others, once rewritten,
are *relations* among the few classes without a rule, a small linear system over the rationals.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from formulations.existence.equations import (
    Frame,
    Multiple,
    Polynomial,
    combined,
    solved_for,
    substituted,
)
from formulations.existence.graphs import ONE, Monomial

Combination: TypeAlias = Mapping[Multiple, Fraction]
# A polynomial in irreducible classes that the equations make zero, its leading coefficient 1,
# and the combination of multiples that rewrites to it.
Relation: TypeAlias = tuple[Polynomial, Combination]


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
        quotients, remainder = _eliminated(
            substituted(polynomial, self.rewritten), self.relations
        )
        used = [(-value, self.averaged[multiple]) for multiple, value in quotients.items()]
        rest = combined([(1, polynomial), (-1, remainder), *used])
        direct: dict[Multiple, Fraction] = {}
        for graph, multiple in reversed(self.rules.items()):
            if graph in rest:
                direct[multiple] = rest[graph] / self.averaged[multiple][graph]
                rest = combined([(1, rest), (-direct[multiple], self.averaged[multiple])])
        assert not rest, "what the relations leave must vanish by the rules"
        return combined([(1, quotients), (1, direct)]), remainder

    def remainder(self, polynomial: Polynomial) -> Polynomial:
        """Return the remainder of `divide`, without the quotients."""
        solved = {graph: solved_for(graph, rest) for graph, (rest, _) in self.relations.items()}
        return substituted(substituted(polynomial, self.rewritten), solved)


def rewriting(frame: Frame, order: int) -> Rewriting:
    """Sort the multiples of a frame's equations, up to an order, into rules and relations."""
    averaged = _simplest_first(frame, order)
    first: dict[Monomial, Multiple] = {}
    for multiple, polynomial in averaged.items():
        first.setdefault(leading(polynomial), multiple)
    rules = {graph: first[graph] for graph in sorted(first, key=size)}
    rewritten: dict[Monomial, Polynomial] = {}
    for graph, multiple in rules.items():
        rewritten[graph] = substituted(solved_for(graph, averaged[multiple]), rewritten)
    relations: dict[Monomial, Relation] = {}
    for multiple, polynomial in averaged.items():
        quotients, rest = _eliminated(substituted(polynomial, rewritten), relations)
        if rest:
            scale = 1 / rest[leading(rest)]
            origin = combined([(scale, {multiple: Fraction(1)}), (-scale, quotients)])
            relations[leading(rest)] = combined([(scale, rest)]), origin
    return Rewriting(averaged, rules, rewritten, relations)


def _simplest_first(frame: Frame, order: int) -> dict[Multiple, Polynomial]:
    """Average all multiples; few vertices, edges and terms first keeps the proof short."""
    averaged = {multiple: frame.averaged(multiple) for multiple in frame.multiples(order)}

    def complexity(item: tuple[Multiple, Polynomial]) -> tuple[int, int, int]:
        vertices, degree, _ = size(leading(item[1]))
        return vertices, degree, len(item[1])

    return dict(sorted(((m, p) for m, p in averaged.items() if p), key=complexity))


def _eliminated(
    polynomial: Polynomial, relations: Mapping[Monomial, Relation]
) -> tuple[Combination, Polynomial]:
    """Subtract relations from a polynomial in irreducible classes, largest class first."""
    used: list[tuple[Fraction, Combination]] = []
    remainder = polynomial
    while reachable := remainder.keys() & relations.keys():
        graph = max(reachable, key=size)
        factor, (relation, origin) = remainder[graph], relations[graph]
        used.append((factor, origin))
        remainder = combined([(1, remainder), (-factor, relation)])
    return combined(used), remainder


def leading(polynomial: Polynomial) -> Monomial:
    """Return the largest class of a polynomial."""
    return max(polynomial, key=size)


def size(graph: Monomial) -> tuple[int, int, Monomial]:
    """Order classes: number of vertices, number of edges, then any fixed order."""
    return len(graph.vertices), graph.degree, graph
