"""The dimension of the space of invariants, counted exactly, by characters."""

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import factorial, prod
from typing import TypeAlias

from lockedjoint.formulations.bounds.moments.row_sectors import label_degree
from lockedjoint.formulations.bounds.moments.tableaux import partitions

# Coefficients by (degree, weight of the frame rotation, phase charge).
Character: TypeAlias = Mapping[tuple[int, int, int], int]


def invariant_dimension(joints: int, degree: int, unsigned: int = 0) -> int:
    """Return dim V for so many joints, d = `degree` and, without signs, d' = `unsigned`."""
    found = _dimension(joints, degree, (0,))
    if unsigned:
        shared = _dimension(joints, min(degree, unsigned), (0,))
        found += _dimension(joints, unsigned, (0, 1)) - shared
    return found


def _dimension(joints: int, degree: int, parities: Sequence[int]) -> int:
    """Return the dimension of the functions of one space, m being even, or of any parity."""
    total = Fraction(0)
    for conjugated in (False, True):
        cycles = {
            length: _cycle(length, degree, conjugated, parities)
            for length in range(1, joints + 1)
        }
        known: dict[tuple[int, ...], Character] = {(): {(0, 0, 0): 1}}
        for lengths in partitions(joints):
            for end, length in enumerate(lengths):
                if lengths[: end + 1] not in known:
                    product = _product(known[lengths[:end]], cycles[length], degree)
                    known[lengths[: end + 1]] = product
            # How often total spin 0 and charge 0 occur: weight 0 less weight 1.
            trivial = sum(
                value * ((weight == 0) - (weight == 1))
                for (_, weight, charge), value in known[lengths].items()
                if charge == 0
            )
            # n! over the number of permutations with these cycles.
            centraliser = prod(k**n * factorial(n) for k, n in Counter(lengths).items())
            total += Fraction(trivial, 2 * centraliser)
    if total.denominator != 1:
        raise ArithmeticError("a dimension must be an integer")
    return int(total)


def _cycle(length: int, degree: int, conjugated: bool, parities: Sequence[int]) -> Character:
    """Return the trace of a cycle of joints on products with m of these parities.

    Conjugation takes m to −m with the sign (−1)^l, and its square is 1.
    """
    found: Counter[tuple[int, int, int]] = Counter()
    for spin in range(degree + 1):
        for m in range(-spin, spin + 1):
            size = length * label_degree((spin, m))
            if m % 2 not in parities or size > degree or (conjugated and length % 2 and m):
                continue
            value = (-1) ** spin if conjugated and length % 2 else 1
            for weight in range(-spin, spin + 1):
                found[size, length * weight, 0 if conjugated else length * m] += value
    return found


def _product(first: Character, second: Character, degree: int) -> Character:
    found: Counter[tuple[int, int, int]] = Counter()
    for (a, weight, charge), value in first.items():
        for (b, other_weight, other_charge), other in second.items():
            if a + b <= degree:
                found[a + b, weight + other_weight, charge + other_charge] += value * other
    return found
