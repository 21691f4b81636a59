"""Every numbered example and claim of the paper, one row each, computed anew.

The files follow the paper: `sections_2_and_3` (bounds, planar and canonical Jacobians),
`section_4` (the equations, with the Appendix), and of Sections 4 and 5 `seven_joints` and
`eight_joints`.
Equations that only define something, (1)–(5) and (8), have no row of their own.
"""

from collections.abc import Iterator, Sequence
from itertools import chain

from lockedjoint.formulations.reproduction import (
    eight_joints,
    section_4,
    sections_2_and_3,
    seven_joints,
)
from lockedjoint.formulations.reproduction.row import ReproductionRow, Verdict

__all__ = ["ReproductionRow", "Verdict", "complaint", "iterate"]


def iterate(seed: int = 0, starts: int = 100) -> Iterator[ReproductionRow]:
    """Compute the rows one by one, in the paper's order.

    Parameters
    ----------
    seed
        Seed of all random starts, at least 0.
    starts
        Random starts of the residual minimisations, at least 1; for 8R at most 50 of them.
        Other searches have numbers of their own.
    """
    return chain(
        sections_2_and_3.bound_rows(seed),
        sections_2_and_3.three_joint_rows(seed),
        sections_2_and_3.four_joint_rows(seed),
        sections_2_and_3.positional_rows(),
        sections_2_and_3.canonical_rows(seed),
        sections_2_and_3.rotation_rows(seed),
        section_4.rows(seed),
        section_4.appendix_rows(seed),
        seven_joints.rows(seed, starts),
        seven_joints.worst_case_rows(seed),
        eight_joints.rows(seed, min(starts, 50)),
    )


def complaint(rows: Sequence[ReproductionRow]) -> str:
    """Return what is wrong with the rows, in a sentence, or nothing."""
    wrong = any(row.verdict is Verdict.MISMATCH for row in rows)
    return "a row is an unexplained mismatch" if wrong else ""
