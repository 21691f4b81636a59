"""An entry of the atlas as a line of a table."""

from dataclasses import dataclass, field

from formulations.atlas.entry import EntryPage
from formulations.io.table import HIDDEN, column


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
