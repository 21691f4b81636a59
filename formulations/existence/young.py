"""Young symmetrisers acting on monomials: polynomials of one irreducible type of S_n."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, permutations, product, zip_longest
from math import gcd, prod
from typing import TypeAlias

from formulations.existence.graphs import Monomial
from formulations.existence.polynomials import Polynomial, collected

Tableau: TypeAlias = tuple[tuple[int, ...], ...]
Permutation: TypeAlias = tuple[int, ...]


def symmetrised(tableau: Tableau, monomial: Monomial) -> Polynomial:
    """Symmetrise a monomial over the rows of a tableau, then antisymmetrise over its columns.

    Parameters
    ----------
    tableau
        Rows of joints, each joint once, rows of decreasing length.
    monomial
        The monomial acted on.

    Returns
    -------
    Polynomial
        Σ sign(c) c·r·monomial over row permutations r and column permutations c, divided by
        the greatest common divisor of its coefficients.
    """
    columns = tuple(
        tuple(joint for joint in column if joint is not None)
        for column in zip_longest(*tableau)
    )
    terms = collected(
        (monomial.relabel(row).relabel(column), Fraction(sign(column)))
        for row in _stabiliser(tableau)
        for column in _stabiliser(columns)
    )
    content = gcd(*(value.numerator for value in terms.values()))
    return {term: value / content for term, value in sorted(terms.items())}


def sign(permutation: Permutation) -> int:
    """Return +1 for an even and −1 for an odd permutation."""
    images = range(len(permutation))
    return prod(-1 for i in images for j in range(i) if permutation[j] > permutation[i])


def _stabiliser(blocks: Sequence[tuple[int, ...]]) -> Iterator[Permutation]:
    """Give all permutations that map every block to itself."""
    joints = tuple(chain(*blocks))
    for images in product(*map(permutations, blocks)):
        moved = dict(zip(joints, chain(*images), strict=True))
        yield tuple(moved[joint] for joint in range(len(joints)))
