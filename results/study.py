"""A study: rows that are computed one by one, and the folder of tables and the page they fill.

A run writes into the subfolder `INCOMPLETE` after every row. When all rows are there, its files
replace those of the run before, and the page comes last: a folder with a page holds the files
of one complete run.

A kind of rows is a frozen dataclass: its fields are the columns of a CSV table. A template
(Jinja) makes the page; it gets the rows of all tables, as they are read from their files.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lockedjoint.formulations.io.files import write_text
from lockedjoint.formulations.io.run_folder import RunFolder
from lockedjoint.formulations.io.table import Table, read_rows
from lockedjoint.formulations.solving.effort import Effort
from results.pages import block, page, prose

# The page of a run that is not complete.
_BEGUN = "Interrupted or still running: nothing is here yet.\n"
#: Rows of tables, by the stems of their CSV files.
Rows = Mapping[str, Sequence[Any]]


@dataclass(frozen=True)
class Result:
    """What a run of a study came to."""

    rows: tuple[Any, ...]  # of all tables, in the order in which they were computed
    complete: bool
    complaint: str = ""  # what is wrong with the rows, in a sentence, or nothing


@dataclass(frozen=True)
class Study:
    """What fills one folder of results.

    Its command runs this study alone, and `takes` so long on two cores, in words.
    """

    name: str  # of the folder
    title: str  # in a few words, for the front page
    page: str  # the folder's Markdown page
    template: Path  # of the page, with the block ``finding``
    tables: Mapping[str, type[Any]]  # kinds of rows by the CSV file's stem, the main one first
    command: str
    takes: str
    # Yields the rows, given a folder for files of its own. A KeyboardInterrupt ends it there.
    compute: Callable[[Effort, Path], Iterator[Any]]
    long: bool = False  # over ten minutes, packages of robots, or an idle machine
    settings: Mapping[str, object] = field(default_factory=dict)  # more for the template
    # What is wrong with the rows, in a sentence, or nothing.
    complain: Callable[[Sequence[Any]], str] = lambda _: ""

    def run(
        self, folder: Path, effort: Effort, each: Callable[[Any], object] = lambda _: None
    ) -> Result:
        """Run the study into a folder; tables and page are written after every row.

        `each` is then called with the row. The result is not complete if the user interrupted;
        what was done is then in the folder's `INCOMPLETE`, and an earlier result stays.
        LockedJointError if the study cannot be run, or the folder not be written to.
        """
        run = RunFolder.begin(folder, self.page, *(f"{stem}.csv" for stem in self.tables))
        write_text(run.part / self.page, _BEGUN)
        rows: list[Any] = []
        try:
            for row in self.compute(effort, run.part):
                rows.append(row)
                self._write(run.part, rows, effort.seed, complete=False)
                each(row)
        except KeyboardInterrupt:
            return Result(tuple(rows), complete=False)
        except Exception:
            run.discard()
            raise
        self._write(run.part, rows, effort.seed, complete=True)
        run.publish()
        return Result(tuple(rows), complete=True, complaint=self.complain(rows))

    def read(self, folder: Path) -> Rows:
        """Return the rows of each table in a folder, none where a table is missing.

        FileError if a table is not of this version.
        """
        rows: dict[str, Sequence[Any]] = {}
        for stem, kind in self.tables.items():
            path = folder / f"{stem}.csv"
            rows[stem] = read_rows(path, kind) if path.exists() else []
        return rows

    def finding(self, tables: Rows) -> str:
        """Return what the tables show as one paragraph, empty if there is nothing to say."""
        return prose(block(self.template, "finding", self._values(tables)))

    def _write(self, part: Path, rows: Sequence[Any], seed: int, complete: bool) -> None:
        for place, (stem, kind) in enumerate(self.tables.items()):
            same = [row for row in rows if isinstance(row, kind)]
            if same or place == 0:
                write_text(part / f"{stem}.csv", Table(kind, same).csv())
        # From the tables as they were written, so that page and tables agree.
        values = {**self._values(self.read(part)), "seed": seed, "complete": complete}
        write_text(part / self.page, page(self.template, values))

    def _values(self, tables: Rows) -> dict[str, object]:
        named = {stem.replace("-", "_"): rows for stem, rows in tables.items()}
        return {**self.settings, **named, "rows": tables[next(iter(self.tables))]}
