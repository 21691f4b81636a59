"""Monomials in the entries of W and its conjugate, as graphs with two edge colours.

A product of entries W_ij and conj(W_ij) of a symmetric n×n matrix is a multigraph: joints are
vertices, every factor W_ij is an edge of the first colour, every factor conj(W_ij) one of the
second. An average over all orders of the joints depends only on the isomorphism class of that
graph; if it is also over complex conjugation, only on the class with colours interchangeable
(docs/nonexistence.md, section 3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import combinations, combinations_with_replacement
from typing import TypeAlias

from formulations.existence.certificate import Pairs

# For each vertex, by rank: its neighbours, with the number of edges of each colour.
Neighbours: TypeAlias = list[list[tuple[int, tuple[int, int]]]]


def _sorted_pairs(pairs: Pairs) -> Pairs:
    return tuple(sorted((i, j) if i <= j else (j, i) for i, j in pairs))


@dataclass(frozen=True, order=True, slots=True)
class Monomial:
    """A product of entries of W (edges `w`) and of its conjugate (edges `wbar`).

    Pairs of joints are counted from 0. Each pair, and the list of pairs, is sorted on creation.
    """

    w: Pairs = ()
    wbar: Pairs = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "w", _sorted_pairs(self.w))
        object.__setattr__(self, "wbar", _sorted_pairs(self.wbar))

    @property
    def degree(self) -> int:
        """Number of factors."""
        return len(self.w) + len(self.wbar)

    @property
    def vertices(self) -> tuple[int, ...]:
        """The joints that occur, ascending."""
        return tuple(sorted({joint for pair in self.w + self.wbar for joint in pair}))

    def conjugate(self) -> Monomial:
        """Return the complex conjugate: the two colours change places."""
        return Monomial(self.wbar, self.w)

    def relabel(self, names: Mapping[int, int] | tuple[int, ...]) -> Monomial:
        """Return the monomial in which joint i is called ``names[i]``."""
        return Monomial(
            tuple((names[i], names[j]) for i, j in self.w),
            tuple((names[i], names[j]) for i, j in self.wbar),
        )

    def __mul__(self, other: Monomial) -> Monomial:
        return Monomial(self.w + other.w, self.wbar + other.wbar)


ONE = Monomial()


def canonical(monomial: Monomial, *, swap_colours: bool = True) -> Monomial:
    """Return the representative of the isomorphism class of a monomial.

    Two monomials have the same representative exactly when a permutation of the joints (and,
    if `swap_colours`, possibly conjugation) takes one to the other. The representative uses
    the joints 0, 1, 2, … without gaps.
    """
    representative = _canonical(monomial)
    if not swap_colours:
        return representative
    return min(representative, _canonical(monomial.conjugate()))


@cache
def classes(joints: int, order: int, *, loops: bool = False) -> tuple[Monomial, ...]:
    """Return one monomial for each class with up to `order` edges of each of both colours.

    That is order k of the moment relaxation. They are in the order of the number of edges, 1
    first. With `loops` diagonal entries W_ii occur.
    """
    found = {
        canonical(graph)
        for edges in range(order + 1)
        for graph in coloured_graphs(joints, edges, edges, loops)
    }
    return tuple(sorted(found, key=lambda graph: (graph.degree, graph)))


@cache
def coloured_graphs(
    joints: int, w: int, wbar: int, loops: bool = False
) -> tuple[Monomial, ...]:
    """Return one monomial per class with `w` and `wbar` edges, the colours distinguished."""
    if w == wbar == 0:
        return (ONE,)
    if w < wbar:
        mirrored = coloured_graphs(joints, wbar, w, loops)
        found = {canonical(graph.conjugate(), swap_colours=False) for graph in mirrored}
    else:
        choose = combinations_with_replacement if loops else combinations
        # Unused joints are equivalent, so two of them are enough.
        found = {
            canonical(graph * Monomial(w=(edge,)), swap_colours=False)
            for graph in coloured_graphs(joints, w - 1, wbar, loops)
            for edge in choose(range(min(joints, len(graph.vertices) + 2)), 2)
        }
    return tuple(sorted(found))


@lru_cache(maxsize=100_000)
def _canonical(monomial: Monomial) -> Monomial:
    """Return the least relabelling over a search tree.

    The tree distinguishes vertices by their neighbourhoods; where some remain equal, it
    individualises each of them in turn. It does not depend on the labels, so isomorphic graphs
    have the same least leaf.
    """
    vertices = monomial.vertices
    leaves = _labellings(_neighbours(monomial), [0] * len(vertices))
    return min(monomial.relabel(dict(zip(vertices, names, strict=True))) for names in leaves)


def _neighbours(monomial: Monomial) -> Neighbours:
    rank = {joint: place for place, joint in enumerate(monomial.vertices)}
    edges: list[dict[int, list[int]]] = [{} for _ in rank]
    for colour, pairs in enumerate((monomial.w, monomial.wbar)):
        for i, j in pairs:
            for here, there in {(rank[i], rank[j]), (rank[j], rank[i])}:
                edges[here].setdefault(there, [0, 0])[colour] += 1
    return [[(there, (a, b)) for there, (a, b) in around.items()] for around in edges]


def _labellings(neighbours: Neighbours, cells: list[int]) -> Iterator[list[int]]:
    """Give the orderings at the leaves of the search tree below an ordered partition."""
    cells = _refined(neighbours, cells)
    equal = [vertex for vertex, cell in enumerate(cells) if cells.count(cell) > 1]
    if not equal:
        yield cells
        return
    cell = min(cells[vertex] for vertex in equal)
    for vertex in equal:
        if cells[vertex] == cell:
            # Doubling makes room for the chosen vertex just before the rest of its cell.
            split = [2 * c + 1 for c in cells]
            split[vertex] -= 1
            yield from _labellings(neighbours, split)


def _refined(neighbours: Neighbours, cells: list[int]) -> list[int]:
    """Split cells until vertices of one cell have equal neighbourhoods; renumber from 0."""
    while True:
        signatures = [
            (
                cells[vertex],
                sorted((edges, vertex == other, cells[other]) for other, edges in around),
            )
            for vertex, around in enumerate(neighbours)
        ]
        order = sorted(signatures)
        # The first position of a signature is the number of its cell.
        refined = [order.index(signature) for signature in signatures]
        if len(set(refined)) == len(set(cells)):
            return refined
        cells = refined
