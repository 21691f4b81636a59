"""What the front page is made from: the rows of the studies that are there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from formulations.files.rows import read_rows
from formulations.reproduction.row import Row as ReproductionRow
from formulations.studies.bounds.rows import BoundRow, ExistenceRow
from formulations.studies.comparison.row import Row as ComparisonRow
from formulations.studies.existence import Fact
from formulations.studies.failures.row import Row as FailureRow
from formulations.studies.robots.survey import SurveyRow
from nlp.errors import FileError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Line = TypeVar("Line", bound=DataclassInstance)


@dataclass(frozen=True)
class Tables:
    """The rows by study; none where a study is not there, or its table is not of this version.

    Attributes
    ----------
    comparisons
        Both sizes.
    reproduction, existence, bounds, relaxations, failures, robots
        As named.
    """

    comparisons: tuple[ComparisonRow, ...] = ()
    reproduction: tuple[ReproductionRow, ...] = ()
    existence: tuple[Fact, ...] = ()
    bounds: tuple[BoundRow, ...] = ()
    relaxations: tuple[ExistenceRow, ...] = ()
    failures: tuple[FailureRow, ...] = ()
    robots: tuple[SurveyRow, ...] = ()

    def plain(self, formulation: str, model: str, joints: int) -> ComparisonRow | None:
        """Return the comparison's row without a variant, if it is there."""
        for row in self.comparisons:
            if (row.formulation, row.model, row.joints) == (formulation, model, joints):
                return None if row.variant else row
        return None


def read_tables(out: Path) -> Tables:
    """Read what is there of the results in a folder."""
    seven = _rows(out / "comparison" / "comparison.csv", ComparisonRow)
    eight = _rows(out / "comparison_8r" / "comparison.csv", ComparisonRow)
    return Tables(
        comparisons=(*seven, *eight),
        reproduction=_rows(out / "reproduction" / "reproduction.csv", ReproductionRow),
        existence=_rows(out / "existence" / "existence.csv", Fact),
        bounds=_rows(out / "bounds" / "bounds.csv", BoundRow),
        relaxations=_rows(out / "bounds" / "relaxations.csv", ExistenceRow),
        failures=_rows(out / "failures" / "failures.csv", FailureRow),
        robots=_rows(out / "robots" / "robots.csv", SurveyRow),
    )


def _rows(path: Path, kind: type[Line]) -> tuple[Line, ...]:
    try:
        return tuple(read_rows(path, kind))
    except FileError:
        return ()
