"""Rows of the moment matrices: which Wigner functions are multiplied, and how they couple.

A label (l, m) stands for the functions D^l_{Mm} of one joint. As a polynomial in the entries of
J its degree is l if l ≡ m (mod 2), else l + 1, because v × ω has degree two. Turning the sign
of a column multiplies it by (−1)^m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

from nlp.errors import InputError

Label: TypeAlias = tuple[int, int]
# The labels of each group of joints.
LabelSet: TypeAlias = tuple[tuple[Label, ...], ...]


@dataclass(frozen=True, order=True)
class RowSector:
    """The products of Wigner functions with one behaviour under all symmetries but S_n.

    InputError unless all numbers are non-negative and k + parity ≡ c ≡ d (mod 2).

    Parameters
    ----------
    odd
        Number k of joints with odd m, a locked one not counted.
    charge
        Sum c of all m, not negative.
    spin
        Total spin L to which the product is coupled.
    degree
        Largest degree d in the entries of J.
    locked
        Parity of m of the locked joint, 0 or 1; None if no joint is locked.
    """

    odd: int
    charge: int
    spin: int
    degree: int
    locked: int | None = None

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        name = "row sector (k, c, L, d, parity)"
        if min(values[:4]) < 0 or self.locked not in (None, 0, 1):
            raise InputError(name, values, "non-negative integers")
        odd = self.odd + (self.locked or 0)
        if (odd - self.charge) % 2 or (self.charge - self.degree) % 2:
            raise InputError(name, values, "k + parity ≡ c ≡ d modulo 2")

    def places(self, joints: int) -> tuple[range, ...]:
        """Return the groups of joints: the locked one if any, odd joints, even joints."""
        start = 0 if self.locked is None else 1
        split = start + self.odd
        groups = (range(start, split), range(split, joints))
        return groups if self.locked is None else (range(1), *groups)

    def label_sets(self, joints: int) -> list[LabelSet]:
        """Return the labels that the groups of `joints` joints can carry."""
        if self.locked is None:
            return _label_sets(self.odd, self.charge, self.degree, joints)
        labels = _labels_of_parity(self.locked, self.degree)
        return [
            ((*head,), *rest)
            for head in _heads(labels, nothing=self.locked == 0)
            for rest in _label_sets(self.odd, *_beyond(self, head), joints - 1)
        ]

    def contains(self, other: RowSector) -> bool:
        """Whether the other sector's rows are all among these."""
        return self.degree >= other.degree and replace(self, degree=other.degree) == other


@dataclass(frozen=True, order=True)
class UnsignedSector:
    """The products with one behaviour under all symmetries, column signs not among them.

    Where the signs of the columns are fixed, m of any parity may occur at any joint. If
    `locked`, joint 0 is, and only the others are permuted. The numbers are non-negative, and
    c ≡ d (mod 2).
    """

    charge: int
    spin: int
    degree: int
    locked: bool = False
    odd: ClassVar[int] = 0  # no joints are set apart by their parity

    def places(self, joints: int) -> tuple[range, ...]:
        """Return the groups of joints: the locked one if any, the others."""
        return (range(1), range(1, joints)) if self.locked else (range(joints),)

    def label_sets(self, joints: int) -> list[LabelSet]:
        """Return the labels that the groups of `joints` joints can carry."""
        labels = sorted(_labels_of_parity(0, self.degree) + _labels_of_parity(1, self.degree))
        found: list[LabelSet] = []
        for head in _heads(labels) if self.locked else [()]:
            charge, degree = _beyond(self, head)
            group = ((*head,),) if self.locked else ()
            found += [
                (*group, rest)
                for size in range(joints - len(group) + 1)
                for rest in _multisets(labels, size, degree)
                if sum(m for _, m in rest) == charge
            ]
        return found


def _heads(labels: list[Label], *, nothing: bool = True) -> list[tuple[Label, ...]]:
    """Return what a locked joint can carry."""
    return [*([()] if nothing else []), *((label,) for label in labels)]


def _beyond(sector: RowSector | UnsignedSector, head: tuple[Label, ...]) -> tuple[int, int]:
    """Return the charge and the degree that a locked joint leaves to the others."""
    charge = sector.charge - sum(m for _, m in head)
    return charge, sector.degree - sum(map(label_degree, head))


def label_degree(label: Label) -> int:
    """Return the degree of D^l_{Mm} as a polynomial in the entries of J."""
    spin, m = label
    return spin + (spin - m) % 2


def degree_sectors(
    degree: int, spins: range, charges: range | None = None, locked: int | None = None
) -> list[RowSector]:
    """Return all sectors of one degree, within the given total spins and charges."""
    allowed = range(degree + 1) if charges is None else charges
    return [
        RowSector(k, c, spin, degree, locked)
        for spin in spins
        for k in range(degree + 1)
        for c in allowed
        if (k + (locked or 0) - degree) % 2 == 0 and (c - degree) % 2 == 0
    ]


def without_repetition(sectors: list[RowSector]) -> tuple[RowSector, ...]:
    """Return the sectors that are not contained in others, sorted."""
    distinct = sorted(set(sectors))
    return tuple(
        sector
        for sector in distinct
        if not any(other != sector and other.contains(sector) for other in distinct)
    )


def _label_sets(odd: int, charge: int, degree: int, joints: int) -> list[LabelSet]:
    """Return the labels with odd and those with even m that `joints` joints can carry.

    There are `odd` labels with odd m; all m add up to `charge` and all degrees to at most
    `degree`. Labels are ascending, and (0, 0) is left out.
    """
    if odd > joints:
        return []
    return [
        (first, second)
        for first in _multisets(_labels_of_parity(1, degree), odd, degree)
        for size in range(joints - odd + 1)
        for second in _multisets(
            _labels_of_parity(0, degree), size, degree - sum(map(label_degree, first))
        )
        if sum(m for _, m in first + second) == charge
    ]


def _labels_of_parity(parity: int, degree: int) -> list[Label]:
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


#: Rows of degree 4, which alone give no more than ρ ≥ 0 for seven joints.
DEGREE_4 = tuple(degree_sectors(4, range(3)))
