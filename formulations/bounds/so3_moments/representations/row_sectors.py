"""Rows of the moment matrices: which Wigner functions are multiplied, and how they couple.

A label (l, m) stands for the functions D^l_{Mm} of one joint. As a polynomial in the entries of
J its degree is l if l ≡ m (mod 2), else l + 1, because v × ω has degree two. Turning the sign
of a column multiplies it by (−1)^m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from nlp.errors import InputError

Label: TypeAlias = tuple[int, int]


@dataclass(frozen=True, order=True)
class RowSector:
    """The products of Wigner functions with one behaviour under all symmetries but S_n.

    Parameters
    ----------
    odd
        Number k of joints with odd m.
    charge
        Sum c of all m, not negative.
    spin
        Total spin L to which the product is coupled.
    degree
        Largest degree d in the entries of J.

    Raises
    ------
    InputError
        Unless all are non-negative and k ≡ c ≡ d (mod 2).
    """

    odd: int
    charge: int
    spin: int
    degree: int

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree)
        if min(values) < 0:
            raise InputError("row sector (k, c, L, d)", values, "non-negative integers")
        if (self.odd - self.charge) % 2 or (self.charge - self.degree) % 2:
            raise InputError("row sector (k, c, L, d)", values, "k ≡ c ≡ d modulo 2")

    def label_sets(self, joints: int) -> list[tuple[tuple[Label, ...], tuple[Label, ...]]]:
        """Return the labels with odd and those with even m that `joints` joints can carry."""
        return label_sets(self.odd, self.charge, self.degree, joints)

    def contains(self, other: RowSector) -> bool:
        """Whether the other sector's rows are all among these."""
        same = (self.odd, self.charge, self.spin) == (other.odd, other.charge, other.spin)
        return same and self.degree >= other.degree


def label_degree(label: Label) -> int:
    """Return the degree of D^l_{Mm} as a polynomial in the entries of J."""
    spin, m = label
    return spin + (spin - m) % 2


def label_sets(
    odd: int, charge: int, degree: int, joints: int
) -> list[tuple[tuple[Label, ...], tuple[Label, ...]]]:
    """Return the labels with odd and those with even m that `joints` joints can carry.

    There are `odd` labels with odd m; all m add up to `charge` and all degrees to at most
    `degree`. Labels are ascending, and (0, 0) is left out.
    """
    if odd > joints:
        return []
    found = []
    for first in _multisets(labels_of_parity(1, degree), odd, degree):
        left = degree - sum(map(label_degree, first))
        for size in range(joints - odd + 1):
            found += [
                (first, second)
                for second in _multisets(labels_of_parity(0, degree), size, left)
                if sum(label[1] for label in first + second) == charge
            ]
    return found


def degree_sectors(
    degree: int, spins: range, *, odd: range | None = None, charges: range | None = None
) -> list[RowSector]:
    """Return all sectors of one degree, within the given total spins, k and charges."""
    counts = range(degree + 1) if odd is None else odd
    allowed = range(degree + 1) if charges is None else charges
    return [
        RowSector(k, c, spin, degree)
        for spin in spins
        for k in counts
        for c in allowed
        if (k - degree) % 2 == 0 and (c - degree) % 2 == 0
    ]


def without_repetition(sectors: list[RowSector]) -> tuple[RowSector, ...]:
    """Return the sectors that are not contained in others, sorted."""
    distinct = sorted(set(sectors))
    return tuple(
        sector
        for sector in distinct
        if not any(other != sector and other.contains(sector) for other in distinct)
    )


def labels_of_parity(parity: int, degree: int) -> list[Label]:
    """Return the labels with m of one parity and degree from 1 to `degree`, ascending."""
    return [
        (spin, m)
        for spin in range(1, degree + 1)
        for m in range(-spin, spin + 1)
        if m % 2 == parity and label_degree((spin, m)) <= degree
    ]


def _multisets(labels: list[Label], size: int, degree: int) -> Iterator[tuple[Label, ...]]:
    """Give the ascending choices of `size` labels with total degree at most `degree`."""
    if size == 0:
        yield ()
        return
    for position, label in enumerate(labels):
        left = degree - label_degree(label)
        if left >= size - 1:
            for rest in _multisets(labels[position:], size - 1, left):
                yield (label, *rest)
