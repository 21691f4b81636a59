"""The dimension of the space V of invariants, counted exactly, by characters.

A joint carries a Wigner function D^l_{Mm} with the label (l, m), see `row_sectors`: l ≥ 0 is
its spin, and M and m are from −l to l. A product of one such function for each of n joints has
the degree Σ `label_degree`, the charge Σ m and the weight Σ M. V holds those combinations of
products that no symmetry changes: rotations of the frame (they act on M), common phases of all
joints (they act on m), conjugation (v, ω) → (v, −ω), and permutations of the joints. It is the
sum of two spaces:

- products of degree at most d with an even m at each joint. The sign of any column does not
  change them either;
- products of degree at most d' with an m of any parity. Single signs can change them, and the
  common sign of all columns cannot, because Σ m = 0. There are none where d' is 0.

The dimension is the mean of the trace of a symmetry over all symmetries. The trace of a
permutation is a product over its cycles: if k joints form a cycle, only products with one
function at all k of them count, and everything that belongs to it occurs k times. The mean over
phases keeps the charge 0. The mean over rotations is the number of weights 0 less that of
weights 1: each total spin L ≥ 1 has both once, and L = 0 has the weight 0 only.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import factorial, prod
from typing import TypeAlias

from lockedjoint.formulations.bounds.moments.row_sectors import label_degree
from lockedjoint.formulations.bounds.moments.tableaux import partitions

#: A trace, split by (degree, weight, charge): the coefficient of each. Where conjugation is
#: part of the symmetry there is no charge, and 0 stands in its place.
Character: TypeAlias = Mapping[tuple[int, int, int], int]

# What m can be modulo 2 in the two spaces.
_EVEN = (0,)
_EVEN_AND_ODD = (0, 1)


def invariant_dimension(joints: int, degree: int, unsigned: int = 0) -> int:
    """Return dim V for n = `joints`, d = `degree` and d' = `unsigned`.

    It is 476 for n = 7 and d = 12, and 719 with d' = 8 as well.
    """
    dimension = _dimension(joints, degree, _EVEN)
    if unsigned:
        # Both spaces hold the products with even m only, up to the smaller degree.
        shared = _dimension(joints, min(degree, unsigned), _EVEN)
        dimension += _dimension(joints, unsigned, _EVEN_AND_ODD) - shared
    return dimension


def _dimension(joints: int, degree: int, parities: Sequence[int]) -> int:
    """Return the dimension of the space with m mod 2 in `parities`, up to a degree.

    It is the mean over permutations, without and with conjugation, of the trivial part of the
    trace. Permutations with the same lengths of cycles have the same trace.
    """
    total = Fraction(0)
    for conjugated in (False, True):
        cycles = {
            length: _cycle_trace(length, degree, conjugated, parities)
            for length in range(1, joints + 1)
        }
        # Products of the traces of the first cycles, by the lengths of these.
        known: dict[tuple[int, ...], Character] = {(): {(0, 0, 0): 1}}
        for lengths in partitions(joints):
            for end, length in enumerate(lengths):
                if lengths[: end + 1] not in known:
                    product = _product(known[lengths[:end]], cycles[length], degree)
                    known[lengths[: end + 1]] = product
            trivial = sum(
                value * ((weight == 0) - (weight == 1))
                for (_, weight, charge), value in known[lengths].items()
                if charge == 0
            )
            # n! over this number is how many permutations have cycles of these lengths.
            centraliser = prod(
                length**count * factorial(count) for length, count in Counter(lengths).items()
            )
            # The 2 is for the mean over both values of `conjugated`.
            total += Fraction(trivial, 2 * centraliser)
    if total.denominator != 1:
        raise ArithmeticError("a dimension must be an integer")
    return int(total)


def _cycle_trace(
    length: int, degree: int, conjugated: bool, parities: Sequence[int]
) -> Character:
    """Return the trace of a cycle of `length` joints, a phase and a rotation, up to a degree.

    All joints of the cycle carry one function D^l_{Mm}, with m mod 2 ∈ `parities`. If
    `conjugated`, conjugation is applied once at each joint, that is `length` times in all. It
    takes m to −m with the sign (−1)^l: an odd number of times leaves (−1)^l at m = 0 and no
    trace elsewhere, an even number is the identity. Phases cancel then.
    """
    trace: Counter[tuple[int, int, int]] = Counter()
    reverses = conjugated and length % 2 == 1
    for spin in range(degree + 1):
        value = (-1) ** spin if reverses else 1
        for m in range(-spin, spin + 1):
            own_degree = length * label_degree((spin, m))
            if m % 2 not in parities or own_degree > degree or (reverses and m):
                continue
            charge = 0 if conjugated else length * m
            for weight in range(-spin, spin + 1):
                trace[own_degree, length * weight, charge] += value
    return trace


def _product(first: Character, second: Character, degree: int) -> Character:
    """Multiply two traces: degrees, weights and charges add up. Larger degrees are left out."""
    product: Counter[tuple[int, int, int]] = Counter()
    for (first_degree, first_weight, first_charge), value in first.items():
        for (second_degree, second_weight, second_charge), other in second.items():
            if first_degree + second_degree <= degree:
                key = (
                    first_degree + second_degree,
                    first_weight + second_weight,
                    first_charge + second_charge,
                )
                product[key] += value * other
    return product
