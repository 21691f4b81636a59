"""Row sectors: which products of Wigner functions behave alike under the symmetries.

A label (l, m) stands for the functions D^l_{Mm} of one joint, see `wigner`. They are
polynomials in the entries of J, of degree l if l ≡ m (mod 2), else l + 1. A change of the
column's sign multiplies them by (−1)^m. J, shape (6, n), is the Jacobian of n unit revolute
joints (`rotations`).

- l, `spin` of a label: it gives the size of the matrix D^l, which has 2l + 1 rows and columns;
  l ≥ 0;
- M: row of D^l, from −l to l. A rotation of the frame mixes the rows, so that labels have no M;
- m: column of D^l, from −l to l. A common phase θ of all joints multiplies it by e^{−imθ};
- parity of a label: m modulo 2;
- k, c, L and d: `odd`, `charge`, `spin` and `degree` of a `RowSector`;
- group of joints: those that a sector treats alike, see `RowSector.groups`;
- S_n: the permutations of the n joints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, product
from typing import NamedTuple, TypeAlias

from lockedjoint.nlp.errors import InputError

#: A label (l, m): the spin, and the column of D^l.
Label: TypeAlias = tuple[int, int]

#: The labels of each group of joints, ascending; joints beyond these have the label (0, 0).
LabelSet: TypeAlias = tuple[tuple[Label, ...], ...]


@dataclass(frozen=True, order=True)
class RowSector:
    """The products of Wigner functions with one behaviour under all symmetries but S_n.

    Attributes
    ----------
    odd
        Number k of joints with odd m, a locked one not counted. None where the signs of the
        columns are fixed: then m of any parity may occur at any joint.
    charge
        Sum c of all m.
    spin
        Total spin L to which the product is coupled.
    degree
        Largest degree d in the entries of J.
    locked
        Parity of m of the locked joint, 0 or 1. If `odd` is None it is 0 and says only that a
        joint is locked. None if no joint is locked.

    Raises
    ------
    InputError
        Unless all numbers are non-negative, c ≡ d and k + parity ≡ c (mod 2).
    """

    odd: int | None
    charge: int
    spin: int
    degree: int
    locked: int | None = None

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        name = "row sector (k, c, L, d, parity)"
        parities = (None, 0) if self.odd is None else (None, 0, 1)
        least = min(self.odd or 0, self.charge, self.spin, self.degree)
        if least < 0 or self.locked not in parities:
            raise InputError(name, values, "non-negative integers")
        # The number of odd m is not fixed without k, and its parity is that of the charge.
        odd = self.charge if self.odd is None else self.odd + (self.locked or 0)
        if (odd - self.charge) % 2 or (self.charge - self.degree) % 2:
            raise InputError(name, values, "k + parity ≡ c ≡ d modulo 2")

    def groups(self, joints: int) -> tuple[range, ...]:
        """Return the groups of `joints` joints: the locked one, those with odd m, the others.

        A group is a range of places in the order of the joints. Without a locked joint there
        is no first group. Where signs are fixed there is one group for all others.
        """
        locked_group = () if self.locked is None else (range(1),)
        start = len(locked_group)
        if self.odd is None:
            return (*locked_group, range(start, joints))
        odd_end = start + self.odd
        return (*locked_group, range(start, odd_end), range(odd_end, joints))

    def label_sets(self, joints: int) -> list[LabelSet]:
        """Return all label sets of the sector for `joints` joints, without labels (0, 0).

        Their m add up to the charge, and their degrees to at most `degree`.
        """
        choices = [
            [
                chosen
                for number in group.numbers
                for chosen in _multisets(group.labels, number, self.degree)
            ]
            for group in self._label_groups(joints)
        ]
        label_sets = []
        for chosen in product(*choices):
            labels = [*chain(*chosen)]
            charge = sum(m for _, m in labels)
            if charge == self.charge and sum(map(label_degree, labels)) <= self.degree:
                label_sets.append(chosen)
        return label_sets

    def _label_groups(self, joints: int) -> list[_LabelGroup]:
        """Return what each of `groups` can carry, in their order."""
        even = _labels(self.degree, (0,))
        odd = _labels(self.degree, (1,))
        both = _labels(self.degree, (0, 1))
        # A label (0, 0) is not written down. It is even: a joint with an odd m has a label, and
        # one with an even m, or any, has a label or none.
        none_or_one = range(2)
        exactly_one = range(1, 2)
        groups: list[_LabelGroup] = []
        if self.locked is not None and self.odd is None:
            groups.append(_LabelGroup(both, none_or_one))
        elif self.locked == 0:
            groups.append(_LabelGroup(even, none_or_one))
        elif self.locked == 1:
            groups.append(_LabelGroup(odd, exactly_one))
        unlocked = joints - len(groups)
        if self.odd is None:
            groups.append(_LabelGroup(both, range(unlocked + 1)))
        else:
            groups.append(_LabelGroup(odd, range(self.odd, self.odd + 1)))
            groups.append(_LabelGroup(even, range(unlocked - self.odd + 1)))
        return groups


class _LabelGroup(NamedTuple):
    """What the joints of one group can carry together."""

    #: The labels that each of them can have, without (0, 0).
    labels: list[Label]
    #: How many of them can have one of these labels.
    numbers: range


def label_degree(label: Label) -> int:
    """Return the degree of D^l_{Mm} as a polynomial in the entries of J."""
    spin, m = label
    return spin + (spin - m) % 2


def degree_sectors(
    degree: int, spins: range, charges: range | None = None, locked: int | None = None
) -> list[RowSector]:
    """Return all sectors of one degree, within the given total spins and charges.

    `locked` is the parity of m of the locked joint, None if no joint is locked. k + parity, c
    and d have the same parity in every sector.
    """
    allowed = range(degree + 1) if charges is None else charges
    return [
        RowSector(odd=k, charge=c, spin=spin, degree=degree, locked=locked)
        for spin, k, c in product(spins, range(degree + 1), allowed)
        if (k + (locked or 0) - degree) % 2 == 0 and (c - degree) % 2 == 0
    ]


def unsigned_sectors(
    degree: int, spins: range, *, locked: bool = False
) -> tuple[RowSector, ...]:
    """Return all sectors of one degree where the signs of the columns are fixed.

    `locked` says whether a joint is locked; its m can have any parity then, and the field
    `RowSector.locked` is 0 by convention.
    """
    locked_field = 0 if locked else None
    charges = range(degree % 2, degree + 1, 2)
    return tuple(
        RowSector(odd=None, charge=c, spin=spin, degree=degree, locked=locked_field)
        for spin in spins
        for c in charges
    )


def without_repetition(sectors: list[RowSector]) -> tuple[RowSector, ...]:
    """Return the sectors, sorted, but only the largest of those that differ only in degree."""
    # A later sector replaces the one before. Sectors are sorted by (odd, charge, spin, degree),
    # so that the degree grows among those with the same other numbers.
    largest = {(one.odd, one.charge, one.spin, one.locked): one for one in sorted(sectors)}
    return tuple(largest.values())


def _labels(degree: int, parities: tuple[int, ...]) -> list[Label]:
    """Return the labels with m of these parities and degree from 1 to `degree`, ascending."""
    return [
        (spin, m)
        for spin in range(1, degree + 1)
        for m in range(-spin, spin + 1)
        if m % 2 in parities and label_degree((spin, m)) <= degree
    ]


def _multisets(labels: list[Label], size: int, degree: int) -> Iterator[tuple[Label, ...]]:
    """Yield the ascending choices of `size` labels with total degree at most `degree`."""
    if size == 0:
        yield ()
        return
    for k, label in enumerate(labels):
        remaining = degree - label_degree(label)
        # Each of the others has degree 1 at least.
        if remaining >= size - 1:
            for others in _multisets(labels[k:], size - 1, remaining):
                yield (label, *others)


#: Sectors of degree 4, with total spins 0 to 2. Alone they give no more than ρ ≥ 0 for seven
#: joints.
DEGREE_4 = tuple(degree_sectors(4, range(3)))
