"""The relaxation on fifty arms: its value, a closed form, the best found, and the time.

The worst case σ of an arm's Jacobian J is its least singular value after the worst joint has
locked. The relaxation is a semidefinite program that bounds σ over all J of an arm from above;
`relaxed` solves it. A search from random starts looks for a J that attains the bound, and a
formula (`row_traces`) bounds σ without a program.

Out come ``relaxation.csv``, a `RelaxationRow` for each arm of `ARMS`, and ``relaxation.svg``.
An arm is words: ``unit-revolute:7,prismatic:2`` has seven joints of one kind and two of
another. Another arm is another entry of `ARMS`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

from lockedjoint.figures.style import BLUE, ORANGE, SMALL, styled
from lockedjoint.formulations import max_min
from lockedjoint.formulations.bounds.certified import largest_worst_case
from lockedjoint.formulations.bounds.relaxed import relaxed
from lockedjoint.formulations.comparison import solve_case
from lockedjoint.formulations.io.table import HIDDEN, column
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures import gap_percent
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.effort import Effort
from results.relaxation.row_traces import spatial_bound
from results.script import main, save, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The number of random starts of the search beside the bound, for each arm. With more of them
# the best found may be larger.
STARTS = 20
#: Arms of the study: kinds of joints, lengths, mixes, and 7 to 20 joints.
ARMS = (
    [f"unit-revolute:{n}" for n in range(7, 21)]
    + [f"lever-revolute:{n}" for n in (7, 8, 9, 10, 12, 14)]
    + [f"lever-revolute(length=0.3):{n}" for n in (7, 8, 10, 12)]
    + [f"lever-revolute-each(length=3):{n}" for n in (7, 8, 10)]
    + [f"unit-revolute:{9 - slides},prismatic:{slides}" for slides in range(1, 5)]
    + [f"lever-revolute:{10 - slides},prismatic:{slides}" for slides in range(1, 6)]
    + [f"lever-revolute-each:7,prismatic(speed={speed}):2" for speed in (0.1, 0.5, 2)]
    + [f"rotor:{n}" for n in (7, 8, 9, 10, 12)]
    + ["rotor:4,counter-rotor:3", "rotor:5,counter-rotor:4"]
    + [f"lever-revolute-each(length=0.3):{n},lever-revolute-each(length=2):{n}" for n in (4, 5)]
    + ["lever-revolute(pitch=0.5):8", "unit-revolute:4,lever-revolute(length=2):4"]
)


# Width and height of the figure in inches.
_SIZE_INCHES = (9.0, 3.6)


@dataclass(frozen=True)
class RelaxationRow:
    """One arm, one locked joint: the columns of ``relaxation.csv``.

    Attributes
    ----------
    model, joints
        The arm.
    value
        The bound on the worst case that the relaxation proves.
    numerical, status
        The bound as the solver gives it, before it is rounded and checked, and whether it
        is ``optimal``.
    closed_form
        What follows from the traces of blocks of rows; NaN where more is known of a column.
    best
        The largest worst case found; NaN if no start passed the check.
    gap_percent
        100·(value − best)/value.
    sharpest, sharpest_kind
        The sharpest bound known, and how.
    reached_best, starts
        How many starts reached the best.
    cpu_seconds
        Processor time of the bound: stating, solving, rounding and checking it.
    """

    model: str
    joints: int = field(metadata=column("n"))
    value: float = field(metadata=column("relaxation", ".7f"))
    numerical: float = field(metadata=HIDDEN)
    status: str = field(metadata=HIDDEN)
    closed_form: float = field(metadata=column("closed form", ".7f"))
    best: float = field(metadata=column("best found", ".7f"))
    gap_percent: float = field(metadata=column("gap %", "z.3f"))
    sharpest: float = field(metadata=HIDDEN)
    sharpest_kind: str = field(metadata=HIDDEN)
    reached_best: int = field(metadata=HIDDEN)
    starts: int = field(metadata=HIDDEN)
    cpu_seconds: float = field(metadata=column("CPU ms", ".0f", scale=1e3))


def compute(effort: Effort, folder: Path) -> Iterator[RelaxationRow]:
    """Bound each arm, and look for a Jacobian that attains the bound."""
    effort = Effort(effort.seed, effort.starts or STARTS, effort.workers, effort.progress)
    rows = []
    relaxed(arm("unit-revolute:7"))  # not timed: what is loaded and set up once
    for model in ARMS:
        row = _row(model, effort)
        rows.append(row)
        yield row
    save(drawn(rows), folder / "relaxation.svg")


def _row(model: str, effort: Effort) -> RelaxationRow:
    """Return the row of an arm, by its model: kinds of joints and their numbers."""
    built = arm(model)
    begun = process_time()
    found = relaxed(built)
    seconds = process_time() - begun
    outcome = solve_case(Case(max_min, built), effort)
    best = outcome.best.score if outcome.reached else math.nan
    closed, sharpest = spatial_bound(built), largest_worst_case(built)
    return RelaxationRow(
        model=model,
        joints=built.shape[1],
        value=found.value,
        numerical=found.solution.bound,
        status=found.solution.status,
        closed_form=math.nan if closed is None else math.sqrt(closed),
        best=best,
        gap_percent=gap_percent(best, found.value),
        sharpest=sharpest.value,
        sharpest_kind=sharpest.kind,
        reached_best=len(outcome.reached),
        starts=len(outcome.records),
        cpu_seconds=seconds,
    )


def drawn(rows: Sequence[RelaxationRow]) -> Figure:
    """Return the figure: value and best found, over n and over prismatic joints."""
    alone = [row for row in rows if row.model.startswith("unit-revolute:")]
    alone = [row for row in alone if "," not in row.model]
    slides = [row for row in rows if row.model.startswith("lever-revolute:")]
    slides = [row for row in slides if ",prismatic:" in row.model]
    counts = [int(row.model.rpartition(":")[2]) for row in slides]
    with styled(*_SIZE_INCHES) as figure:
        left, right = figure.subplots(1, 2)
        for axes, places, chosen in (
            (left, [row.joints for row in alone], alone),
            (right, counts, slides),
        ):
            axes.plot(places, [row.value for row in chosen], color=BLUE, label="relaxation")
            best = [row.best for row in chosen]
            axes.plot(places, best, "o", color=ORANGE, label="best found")
            axes.set_ylabel("worst case σ")
            axes.legend(fontsize=SMALL, frameon=False)
        left.set(xlabel="joints n", title="unit revolute joints")
        right.set_xticks(counts)
        right.set(xlabel="prismatic joints of ten", title="the others with free lever arms")
    return figure


STUDY = study_of(
    __file__,
    compute,
    RelaxationRow,
    title="the relaxation on fifty arms, beside the best found",
    takes="four minutes, and matplotlib",
)

if __name__ == "__main__":
    main(STUDY, __file__)
