"""The atlas as a study: a row for each entry, and a map of what is left to gain."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from formulations.atlas.collection import pages, problem_of
from formulations.atlas.entry import EntryPage
from formulations.io.table import HIDDEN, column
from formulations.max_min import NAME as MAX_MIN
from formulations.plot.style import content
from formulations.studies.study import Effort, Part, Study

_DRAWN = 8  # joints that an arm on the page has at most


@dataclass(frozen=True)
class AtlasRow:
    """One entry: the columns of ``atlas.csv``.

    Attributes
    ----------
    entry, model, task_dimension, joints, locked, formulation
        What is asked for; see `formulations.atlas.entry.Entry`.
    value
        Worst case, or least relative manipulability, of the best Jacobian known, proved from
        below.
    bound, kind
        The sharpest upper bound, and how it is known.
    gap_percent
        Between them, in percent of the bound.
    mark
        ``optimal``, ``conjectured`` or ``open``.
    family
        Dimension of the optima around it.
    reached_best, starts
        How many random starts reached it, of how many.
    cpu_seconds
        Processor time of all starts.
    by, date
        Who found it, and when the entry was written.
    """

    entry: str = field(metadata=column(brief=True))
    model: str = field(metadata=HIDDEN)
    task_dimension: int = field(metadata=HIDDEN)
    joints: int = field(metadata=HIDDEN)
    locked: int = field(metadata=HIDDEN)
    formulation: str = field(metadata=HIDDEN)
    value: str = field(metadata=column(brief=True))
    bound: float = field(metadata=column("bound", ".9f", brief=True))
    kind: str = field(metadata=column("known by"))
    gap_percent: float = field(metadata=column("gap %", "z.3f", brief=True))
    mark: str = field(metadata=column(brief=True))
    family: int | None = field(
        metadata=column("family", lambda row: "–" if row.family is None else str(row.family))
    )
    reached_best: int = field(
        metadata=column("reached", lambda row: f"{row.reached_best}/{row.starts}", brief=True)
    )
    starts: int = field(metadata=HIDDEN)
    cpu_seconds: float = field(metadata=column("CPU (s)", ".0f"))
    by: str = field(metadata=HIDDEN)
    date: str = field(metadata=column())

    @property
    def section(self) -> str:
        """Which table of the page it is in."""
        kinds = "revolute and prismatic" if "prismatic" in self.model else self.model
        return f"{kinds}, m = {self.task_dimension}"


def row_of(page: EntryPage) -> AtlasRow:
    """Return an entry's row."""
    bound = page.entry.bound
    return AtlasRow(
        entry=page.entry.name,
        **vars(page.entry),
        value=page.value,
        bound=bound.value,
        kind=bound.kind,
        gap_percent=page.gap_percent,
        mark=page.mark,
        family=page.family,
        reached_best=page.found.reached_best,
        starts=page.found.starts,
        cpu_seconds=page.found.cpu_seconds,
        by=page.found.by,
        date=page.found.date,
    )


def study() -> Study:
    """Return the study of the atlas: every entry verified, and shown in a table."""
    return Study(
        name="atlas",
        title="the best Jacobian known of every kind of arm, beside the bounds",
        page="atlas.md",
        template="atlas.md.j2",
        tables={"atlas": AtlasRow},
        command="lockedjoint report --only atlas --out results",
        takes="a minute",
        compute=_compute,
    )


def _compute(effort: Effort, _: Path) -> Iterator[Part]:
    from formulations.plot.atlas import gallery, heat_map

    rows, arms = [], {}
    for page in pages():
        effort.progress(page.entry.name)
        if problem := problem_of(page):
            raise ArithmeticError(f"{page.entry.name}: {problem}")
        row = row_of(page)
        rows.append(row)
        if row.formulation == MAX_MIN and row.joints <= _DRAWN and _is_arm(row):
            model = row.model.replace(",", ",\n")
            size = f"{row.task_dimension}×{row.joints}, k = {row.locked}"
            arms[f"{model}\n{size}"] = page.jacobian
    frame = [
        (row.model, row.task_dimension, row.joints, row.locked, row.gap_percent)
        for row in rows
        if row.formulation == MAX_MIN
    ]
    effort.progress("drawings")
    files = {
        "gaps.svg": content(heat_map(frame), "svg"),
        "arms.png": content(gallery(arms), "png"),
    }
    yield Part(rows=rows, files=files)


def _is_arm(row: AtlasRow) -> bool:
    """Whether the columns are those of joints: free ones in the plane and in space are."""
    return row.model != "free-mean" or row.task_dimension < 6
