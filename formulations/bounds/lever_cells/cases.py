"""Arrays that belong to N cases, of which some can be taken."""

from dataclasses import dataclass, fields
from typing import Self

from lockedjoint.formulations.bounds.lever_cells.corners import Which


@dataclass(frozen=True)
class Cases:
    """What each of N cases has: arrays with N entries along the first axis, or cases."""

    def take(self, which: Which) -> Self:
        """Return some of the cases, by their numbers, a slice or a truth value for each."""
        values = (getattr(self, field.name) for field in fields(self))
        return type(self)(
            *(part.take(which) if isinstance(part, Cases) else part[which] for part in values)
        )
