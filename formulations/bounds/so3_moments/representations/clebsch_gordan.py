"""Clebsch–Gordan coefficients of integer spins, and spins coupled one after another.

Condon–Shortley phases throughout; components run from −l to l.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from math import factorial, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


@cache
def coupling(first: int, second: int, total: int) -> Floats:
    """Return ⟨first a, second b | total M⟩, shape (2·first+1, 2·second+1, 2·total+1).

    Each entry is the correctly rounded square root of an exact rational, to within two units
    in the last place.
    """
    table = np.zeros((2 * first + 1, 2 * second + 1, 2 * total + 1))
    for a in range(-first, first + 1):
        for b in range(-second, second + 1):
            if abs(a + b) <= total:
                table[first + a, second + b, total + a + b] = _coefficient(
                    first, a, second, b, total
                )
    table.flags.writeable = False
    return table


def _coefficient(first: int, a: int, second: int, b: int, total: int) -> float:
    """Return one coefficient by Racah's formula."""
    if not abs(first - second) <= total <= first + second:
        return 0.0
    m = a + b
    series = Fraction(0)
    for k in range(first + second - total + 1):
        parts = (
            k,
            first + second - total - k,
            first - a - k,
            second + b - k,
            total - second + a + k,
            total - first - b + k,
        )
        if min(parts) >= 0:
            product = 1
            for part in parts:
                product *= factorial(part)
            series += Fraction((-1) ** k, product)
    triangle = Fraction(
        (2 * total + 1)
        * factorial(total + first - second)
        * factorial(total - first + second)
        * factorial(first + second - total),
        factorial(first + second + total + 1),
    )
    components = (
        factorial(total + m)
        * factorial(total - m)
        * factorial(first - a)
        * factorial(first + a)
        * factorial(second - b)
        * factorial(second + b)
    )
    square = triangle * components * series**2
    return sqrt(square) if series >= 0 else -sqrt(square)


@cache
def coupled_tensors(spins: tuple[int, ...], total: int) -> Floats:
    """Return an orthonormal basis of the ways to couple spins to a total spin, in sequence.

    Parameters
    ----------
    spins
        The spins l_1, …, l_p, in the order of coupling; none gives total spin 0.
    total
        The total spin L.

    Returns
    -------
    numpy.ndarray
        Shape (ways, 2l_1+1, …, 2l_p+1, 2L+1). For each way and each component of L a tensor of
        norm 1. Changing the sign of all components multiplies it by (−1)^(Σ l_i − L).
    """
    if not spins:
        return np.ones((1, 1)) if total == 0 else np.zeros((0, 2 * total + 1))
    partial: dict[int, list[Floats]] = {spins[0]: [np.eye(2 * spins[0] + 1)]}
    for position, spin in enumerate(spins[1:], start=1):
        rest = sum(spins[position + 1 :])
        grown: dict[int, list[Floats]] = {}
        for reached, tensors in partial.items():
            for target in range(abs(reached - spin), reached + spin + 1):
                if target <= total + rest:
                    grown.setdefault(target, []).extend(
                        np.tensordot(tensor, coupling(reached, spin, target), axes=1)
                        for tensor in tensors
                    )
        partial = grown
    found = partial.get(total, [])
    shape = (0, *(2 * spin + 1 for spin in spins), 2 * total + 1)
    return np.stack(found) if found else np.zeros(shape)


def axis_exchange(spins: Sequence[int], total: int, order: Sequence[int]) -> Floats:
    """Return how reordering the factors acts on the basis of `coupled_tensors`.

    Parameters
    ----------
    spins, total
        As in `coupled_tensors`.
    order
        Factor q of the reordered tensor is factor order[q] of the given one.

    Returns
    -------
    numpy.ndarray
        Orthogonal matrix X, (ways, ways): reordered tensor b = Σ_c X[c, b] · tensor c of the
        reordered spins.
    """
    given = coupled_tensors(tuple(spins), total)
    if list(order) == list(range(len(order))):
        return np.eye(len(given))
    goal = coupled_tensors(tuple(spins[q] for q in order), total)
    moved = given.transpose(0, *(1 + q for q in order), given.ndim - 1)
    # Every component of L gives the same overlaps; the highest one is enough.
    return np.asarray(
        goal[..., -1].reshape(len(goal), -1) @ moved[..., -1].reshape(len(moved), -1).T
    )
