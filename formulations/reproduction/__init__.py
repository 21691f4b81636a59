"""Every numbered example and claim of the paper, one row each, computed anew.

The files follow the paper: `definition` is Section 2; `planar_3r`, `planar_4r`,
`positional_4r`, `canonical` and `rotated_canonical` are Section 3; `rotational`,
`seven_joints`, `seven_joints_worst_case`, `eight_joints` and `eight_joints_family` are
Sections 4 and 5; `appendix` is the Appendix. Equations that only define something, (1)–(5)
and (8), have no row of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from formulations.reproduction import (
    appendix,
    canonical,
    definition,
    eight_joints,
    eight_joints_family,
    planar_3r,
    planar_4r,
    positional_4r,
    rotated_canonical,
    rotational,
    seven_joints,
    seven_joints_worst_case,
)
from formulations.reproduction.row import Row, Verdict
from nlp.arrays import whole_number

__all__ = ["Row", "Verdict", "has_mismatch", "iterate", "reproduce"]


def iterate(seed: int = 0, starts: int = 100) -> Iterator[Row]:
    """Compute the rows one by one, in the paper's order.

    Parameters
    ----------
    seed
        Seed of all random starts, at least 0.
    starts
        Random starts of the residual minimisations, at least 1; for 8R at most 50 of them.
        Other searches have numbers of their own.

    Raises
    ------
    InputError
        If a number is out of range; at once, before any row.
    """
    return _rows(whole_number("seed", seed, 0), whole_number("starts", starts, 1))


def reproduce(
    seed: int = 0, starts: int = 100, report: Callable[[Row], None] | None = None
) -> tuple[Row, ...]:
    """Compute all rows.

    Parameters
    ----------
    seed, starts
        See `iterate`.
    report
        Called with each row as soon as it is there.
    """
    rows = []
    for row in iterate(seed, starts):
        rows.append(row)
        if report is not None:
            report(row)
    return tuple(rows)


def has_mismatch(rows: Iterable[Row]) -> bool:
    """Whether any row differs from the paper without an explanation."""
    return any(row.verdict is Verdict.MISMATCH for row in rows)


def _rows(seed: int, starts: int) -> Iterator[Row]:
    yield from definition.rows(seed)
    yield from planar_3r.rows(seed)
    yield from planar_4r.rows(seed)
    yield from positional_4r.rows()
    yield from canonical.rows(seed)
    yield from rotated_canonical.rows(seed)
    yield from rotational.rows(seed)
    yield from appendix.rows(seed)
    yield from seven_joints.rows(seed, starts)
    yield from seven_joints_worst_case.rows(seed)
    yield from eight_joints.rows(seed, min(starts, 50))
    yield from eight_joints_family.rows(seed, min(starts, 50))
