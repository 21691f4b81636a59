"""The dimension of the space of invariants, counted by characters.

The space V is that of the functions on SO(3)ⁿ which are polynomials of degree at most d in the
entries of J and do not change under rotations of the frame, a common phase, conjugation, or
signs and order of the columns. Its dimension is the average of the trace over these groups,
counted exactly: only integers and fractions occur.
"""

from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from math import factorial, prod
from typing import TypeAlias

from formulations.bounds.so3_moments.representations.row_sectors import label_degree
from formulations.existence.relaxation.tableaux import partitions
from nlp.arrays import whole_number

# Coefficients by (degree, weight of the frame rotation, phase charge).
Character: TypeAlias = Mapping[tuple[int, int, int], int]


def invariant_dimension(joints: int, degree: int) -> int:
    """Return the dimension of the space of invariants of degree at most `degree`.

    Raises
    ------
    InputError
        Unless both are positive integers.
    """
    whole_number("joints", joints, 1)
    whole_number("degree", degree, 1)
    total = Fraction(0)
    for conjugated in (False, True):
        cycles = {length: _cycle(length, degree, conjugated) for length in range(1, joints + 1)}
        known: dict[tuple[int, ...], Character] = {(): {(0, 0, 0): 1}}
        for lengths in partitions(joints):
            for end, length in enumerate(lengths):
                if lengths[: end + 1] not in known:
                    product = _product(known[lengths[:end]], cycles[length], degree)
                    known[lengths[: end + 1]] = product
            share = Fraction(1, _centraliser(lengths))
            total += share * _trivial_part(known[lengths]) / 2
    if total.denominator != 1:
        raise ArithmeticError("a dimension must be an integer")
    return int(total)


def _cycle(length: int, degree: int, conjugated: bool) -> Character:
    """Return the trace of a cycle of joints on products that are even in every joint.

    It is the trace of the `length`-th power of what acts on one joint. Conjugation takes m to
    −m with the sign (−1)^l, and its square is 1.
    """
    found: Counter[tuple[int, int, int]] = Counter()
    for spin in range(degree + 1):
        for m in range(-spin, spin + 1):
            size = length * label_degree((spin, m))
            if m % 2 or size > degree or (conjugated and length % 2 and m):
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


def _trivial_part(character: Character) -> int:
    """Return how often total spin 0 and charge 0 occur: weight 0 less weight 1."""
    return sum(
        value * ((weight == 0) - (weight == 1))
        for (_, weight, charge), value in character.items()
        if charge == 0
    )


def _centraliser(lengths: tuple[int, ...]) -> int:
    """Return n! over the number of permutations with these cycles."""
    return prod(length**n * factorial(n) for length, n in Counter(lengths).items())
