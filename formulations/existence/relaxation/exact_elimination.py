"""Solve sparse linear equations over the rationals, so that a rank is never a guess."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

Row: TypeAlias = dict[int, Fraction]


@dataclass(frozen=True)
class Elimination:
    """The reduced echelon form of equations Σ_c row[c]·x_c = 0 in which x_0 = 1.

    Parameters
    ----------
    rank
        Rank of the coefficients of x_1, x_2, …
    consistent
        Whether there is a solution at all.
    solved
        For every determined unknown, its value as a combination of x_0 and the undetermined
        unknowns. Empty if the equations are inconsistent.
    """

    rank: int
    consistent: bool
    solved: Mapping[int, Row]


def eliminate(rows: Iterable[Mapping[int, Fraction]]) -> Elimination:
    """Return the reduced echelon form; the last unknowns are determined first.

    Parameters
    ----------
    rows
        Coefficients of the unknowns, by number; unknown 0 is the constant 1.
    """
    leading: dict[int, Row] = {}
    for given in rows:
        row = dict(given)
        while row:
            last = max(row)
            if last not in leading:
                scale = row.pop(last)
                # Kept solved for its last unknown: x_last = Σ leading[last][c]·x_c.
                leading[last] = {c: -value / scale for c, value in row.items()}
                break
            _add(row, leading[last], row.pop(last))
    consistent = 0 not in leading
    rank = len(leading) - (not consistent)
    return Elimination(rank, consistent, _back_substituted(leading) if consistent else {})


def _back_substituted(leading: Mapping[int, Row]) -> dict[int, Row]:
    solved: dict[int, Row] = {}
    for last in sorted(leading):
        row: Row = {}
        for c, value in leading[last].items():
            _add(row, solved.get(c, {c: Fraction(1)}), value)
        solved[last] = row
    return solved


def _add(row: Row, other: Mapping[int, Fraction], factor: Fraction) -> None:
    """Add a multiple of another row in place, and drop what cancels."""
    for c, value in other.items():
        total = row.get(c, 0) + factor * value
        if total:
            row[c] = Fraction(total)
        else:
            row.pop(c, None)
