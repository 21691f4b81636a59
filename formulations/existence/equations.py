"""Monomials as coloured graphs, sparse polynomials, and the equations of isotropic Jacobians.

A product of entries W_ij and conj(W_ij) is a multigraph: joints are vertices, W_ij is an edge
of the first colour, conj(W_ij) one of the second. An average over joint orders and conjugation
depends only on its class, colours interchangeable (docs/nonexistence.md, section 3). With
orthonormal rows, Z = V + iΩ, W = ZᵀZ and P = JᵀJ the equations are (section 2 there)

    row-sum  W 1 = 0  (n = m + 1),   square  W² = 0,   tight-frame  W conj(W) + conj(W) W = 4P

and W_ii = 0, which every unit revolute joint obeys, is built in unless `diagonal` is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import combinations, combinations_with_replacement
from typing import TypeAlias, TypeVar

from lockedjoint.formulations.existence.certificate import EquationKind, Pairs

#: The neighbours of each vertex, by rank, with the number of edges of each colour. The rank of
#: a vertex is its place among those that occur.
Neighbours: TypeAlias = list[list[tuple[int, tuple[int, int]]]]


def _sorted_pairs(pairs: Pairs) -> Pairs:
    """Return pairs in a fixed order, the smaller joint of each first: W is symmetric."""
    return tuple(sorted((i, j) if i <= j else (j, i) for i, j in pairs))


@dataclass(frozen=True, order=True, slots=True)
class Monomial:
    """A product of entries of W (edges `w`) and of its conjugate (edges `wbar`), sorted."""

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
    """Return the representative of a monomial's class: the same for the same class only.

    Members differ by a permutation of the joints, and by conjugation if `swap_colours`.
    """
    forms = (monomial, monomial.conjugate()) if swap_colours else (monomial,)
    return min(map(_canonical, forms))


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
    """Return the least relabelling over a search tree, which does not depend on the labels.

    It tells vertices apart by their neighbourhoods, and individualises each of equal ones.
    """
    vertices = monomial.vertices
    leaves = _labellings(_neighbours(monomial), [0] * len(vertices))
    return min(monomial.relabel(dict(zip(vertices, names, strict=True))) for names in leaves)


def _neighbours(monomial: Monomial) -> Neighbours:
    """Return the neighbours of each vertex of a graph."""
    rank = {joint: place for place, joint in enumerate(monomial.vertices)}
    edges: list[dict[int, list[int]]] = [{} for _ in rank]
    for colour, pairs in enumerate((monomial.w, monomial.wbar)):
        for i, j in pairs:
            for here, there in {(rank[i], rank[j]), (rank[j], rank[i])}:
                edges[here].setdefault(there, [0, 0])[colour] += 1
    return [[(there, (a, b)) for there, (a, b) in around.items()] for around in edges]


def _labellings(neighbours: Neighbours, cells: list[int]) -> Iterator[list[int]]:
    """Yield the orderings at the leaves of the search tree below an ordered partition.

    `cells` has the number of each vertex's cell; at a leaf every cell has one vertex.
    """
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
            (cell, sorted((edges, vertex == other, cells[other]) for other, edges in around))
            for vertex, (cell, around) in enumerate(zip(cells, neighbours, strict=True))
        ]
        order = sorted(signatures)
        # The first position of a signature is the number of its cell.
        refined = [order.index(signature) for signature in signatures]
        if len(set(refined)) == len(set(cells)):
            return refined
        cells = refined


#: The coefficient of each monomial.
Polynomial: TypeAlias = Mapping[Monomial, Fraction]
Key = TypeVar("Key")

#: Number of factors W minus number of factors conj(W) in each equation.
CHARGE: dict[EquationKind, int] = {"row-sum": 1, "square": 2, "tight-frame": 0}


def collected(terms: Iterable[tuple[Key, Fraction]]) -> dict[Key, Fraction]:
    """Add up terms and drop those that cancel."""
    total: dict[Key, Fraction] = {}
    for key, coefficient in terms:
        # Most keys occur once, and a sum of fractions takes long.
        total[key] = total[key] + coefficient if key in total else coefficient
    return {key: value for key, value in total.items() if value}


def combined(
    parts: Iterable[tuple[Fraction | int, Mapping[Key, Fraction]]],
) -> dict[Key, Fraction]:
    """Return the linear combination Σ factor · part, e.g. of polynomials."""
    return collected(
        (key, value if factor == 1 else factor * value)
        for factor, part in parts
        for key, value in part.items()
    )


def solved_for(monomial: Monomial, polynomial: Polynomial) -> Polynomial:
    """Return what a monomial equals where a polynomial that contains it is zero."""
    scale = -1 / polynomial[monomial]
    return {m: scale * value for m, value in polynomial.items() if m != monomial}


def substituted(polynomial: Polynomial, values: Mapping[Monomial, Polynomial]) -> Polynomial:
    """Replace the monomials that have values, until none of them occurs."""
    while replaced := polynomial.keys() & values.keys():
        kept = {m: value for m, value in polynomial.items() if m not in replaced}
        others = [(polynomial[m], values[m]) for m in polynomial if m in replaced]
        polynomial = combined([(1, kept), *others])
    return polynomial


def hermitian_product(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p · conj(q)."""
    return collected((a * b.conjugate(), x * y) for a, x in p.items() for b, y in q.items())


def class_sums(polynomial: Polynomial) -> Polynomial:
    """Return the average over joint orders and conjugation, as a combination of classes."""
    return collected((canonical(monomial), value) for monomial, value in polynomial.items())


@dataclass(frozen=True, order=True, slots=True)
class Multiple:
    """A monomial times an equation at a row ``(i,)`` or an entry ``(i, j)``: zero if solved."""

    kind: EquationKind
    place: tuple[int, ...]
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

    def polynomial(self, kind: EquationKind, place: tuple[int, ...]) -> Polynomial:
        """Return the left-hand side of an equation."""
        columns = [k for k in range(self.joints) if self.diagonal or k not in place]
        if kind == "row-sum":
            (row,) = place
            return collected((Monomial(((row, j),)), Fraction(1)) for j in columns)
        i, j = place
        paths = [((i, k), (k, j)) for k in columns]
        if kind == "square":
            return collected((Monomial(path), Fraction(1)) for path in paths)
        products = [Monomial((a,), (b,)) for a, b in paths]
        terms = [(term, Fraction(1)) for m in products for term in (m, m.conjugate())]
        return collected([*terms, (ONE, -4 * self.projector(i, j))])

    def averaged(self, multiple: Multiple) -> Polynomial:
        """Return a multiple of an equation as a combination of classes."""
        equation = self.polynomial(multiple.kind, multiple.place)
        return class_sums({multiple.monomial * m: value for m, value in equation.items()})

    def multiples(self, order: int) -> Iterator[Multiple]:
        """Yield all multiples with at most `order` edges of each colour, some repeatedly.

        The number of edges of both colours is the same. Others are not needed: a common phase
        of all W changes no equation, and turns their averages.
        """
        for kind, charge in CHARGE.items():
            if kind == "row-sum" and not self.redundant:
                continue
            own_wbar = int(kind == "tight-frame")
            indices = 1 if kind == "row-sum" else 2
            for w in range(order - charge - own_wbar + 1):
                for monomial in coloured_graphs(self.joints, w, w + charge, self.diagonal):
                    # Places among the joints used and as many unused ones as can matter.
                    joints = range(min(self.joints, len(monomial.vertices) + indices))
                    for place in combinations_with_replacement(joints, indices):
                        yield Multiple(kind, place, monomial)
