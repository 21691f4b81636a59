"""A study: a generator of rows, and what makes one folder of the results from them.

A folder of results holds a complete result, or none. While a study runs, its files are in the
folder `INCOMPLETE` within, and its page says so. When it is complete, that folder is renamed to
`COMPLETE` and its files replace those of the result before, one by one: first the page, still
saying that rows are missing, and last the page that says no such thing. A run that is killed in
between leaves all files of the new result in the two folders; the next run moves the rest.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from formulations.io.table import Table, read_rows
from formulations.solving.case import Case
from formulations.solving.outcome import Outcome
from formulations.solving.solve import run
from formulations.studies import pages
from nlp.errors import FileError
from nlp.files import prepare_file, prepare_folder, write_bytes, write_text

#: Within the folder of a result: what is being computed, and what is complete but not in place.
INCOMPLETE, COMPLETE = "incomplete", ".complete"
_REPLACING = (
    "Interrupted while these files were replaced: not all of them are of one run.\n"
    f"The others are in `{COMPLETE}`; the next run moves them here.\n"
)
_BEGUN = "Interrupted or still running: nothing is here yet.\n"
Rows = Mapping[str, Sequence[Any]]


@dataclass(frozen=True)
class Effort:
    """How a study is run.

    Attributes
    ----------
    seed
        Of all random starts.
    starts
        Random starts of each row; None for as many as the study usually makes.
    workers
        Processes.
    progress
        Is called with what is being done, in a few words.
    bars
        Whether many starts show a progress bar.
    """

    seed: int = 0
    starts: int | None = None
    workers: int = 1
    progress: Callable[[str], None] = lambda _: None
    bars: bool = False

    def solve(self, case: Case, usual: int) -> Outcome:
        """Solve from all starts, `usual` if no number was asked for.

        Parameters
        ----------
        case
            What to solve.
        usual
            Number of starts.

        Raises
        ------
        KeyboardInterrupt
            If the user interrupted before the first start ended.
        """
        outcome = run(
            case,
            starts=self.starts or usual,
            seed=self.seed,
            workers=self.workers,
            progress=self.bars,
        )
        if not outcome.records:
            raise KeyboardInterrupt
        try:
            _ = outcome.distinct_optima  # now, where an interrupt loses nothing
        except KeyboardInterrupt:
            outcome = replace(outcome, complete=False)
        return outcome


@dataclass(frozen=True)
class Part:
    """What a study has found next.

    Attributes
    ----------
    rows
        Rows of any of its tables, to be added to them.
    entries
        What goes into the JSON file beside the tables.
    files
        Other files and their content, by name.
    replaces
        How many of the latest rows these rows take the place of.
    complete
        Whether all starts of the rows ended; if not, the study ends here.
    """

    rows: Sequence[Any] = ()
    entries: Sequence[Mapping[str, Any]] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    replaces: int = 0
    complete: bool = True


@dataclass(frozen=True)
class Result:
    """What a run of a study came to.

    Attributes
    ----------
    rows
        Of all tables, in the order in which they were found.
    complete
        Whether nothing is missing.
    complaint
        What is wrong with what was found, in a sentence, or nothing.
    """

    rows: tuple[Any, ...]
    complete: bool
    complaint: str = ""


@dataclass(frozen=True)
class Study:
    """What fills one folder of the results.

    Attributes
    ----------
    name
        Of the folder.
    title
        In a few words, for the front page.
    page
        The folder's Markdown page.
    template
        What the page is made from: a file in ``templates``, with the block ``finding``.
    tables
        The kind of row of each CSV file, by the file's stem; the main table first.
    command
        The command that runs this study alone.
    takes
        How long that takes on two cores, in words.
    compute
        Yields what is found. It is given the effort and the folder, which may hold files of
        an earlier run. Its own files of this run are in the folder's `INCOMPLETE`.
    long
        Whether it takes over ten minutes.
    entries
        The JSON file of the parts' entries; empty if there is none.
    settings
        What else the template needs.
    check
        Raises an error, before anything is written, if the study cannot be run.
    complain
        Returns what is wrong with the rows, in a sentence, or nothing.
    """

    name: str
    title: str
    page: str
    template: str
    tables: Mapping[str, type[Any]]
    command: str
    takes: str
    compute: Callable[[Effort, Path], Iterator[Part]]
    long: bool = False
    entries: str = ""
    settings: Mapping[str, object] = field(default_factory=dict)
    check: Callable[[], object] = lambda: None
    complain: Callable[[Sequence[Any]], str] = lambda _: ""

    @property
    def table(self) -> str:
        """The main CSV file."""
        return f"{next(iter(self.tables))}.csv"

    @property
    def files(self) -> tuple[str, ...]:
        """The files that every run writes."""
        return tuple(name for name in (self.table, self.page, self.entries) if name)

    def run(
        self, folder: Path, effort: Effort, each: Callable[[Part], object] = lambda _: None
    ) -> Result:
        """Run the study into a folder; tables and page are written after every part.

        Parameters
        ----------
        folder
            Made if missing.
        effort
            How it is run.
        each
            Is called with every part, after it is written.

        Returns
        -------
        Result
            Not complete if the user interrupted; what was done is then in the folder's
            `INCOMPLETE`, and an earlier result stays as it was.

        Raises
        ------
        LockedJointError
            If the study cannot be run, or the folder not be written to.
        """
        self.check()
        prepare_folder(folder)
        for name in (*self.files, *(f"{stem}.csv" for stem in self.tables)):
            prepare_file(folder / name, "output file")
        part = folder / INCOMPLETE
        _publish(folder, self.page)  # left over from a run that was killed
        self.discard(folder)
        write_text(prepare_folder(part) / self.page, _BEGUN)
        rows: list[Any] = []
        entries: list[Mapping[str, Any]] = []
        complete = False
        try:
            for found in self.compute(effort, folder):
                rows = [*rows[: len(rows) - found.replaces], *found.rows]
                entries += found.entries
                for name, content in found.files.items():
                    write_bytes(part / name, content)
                self._write(folder, rows, entries, effort.seed, complete=False)
                each(found)
                if not found.complete:
                    break
            else:
                self._write(folder, rows, entries, effort.seed, complete=True)
                part.rename(folder / COMPLETE)
                _publish(folder, self.page)
                complete = True
        except KeyboardInterrupt:
            pass  # what is done is kept, and the page says that it is not all
        return Result(tuple(rows), complete, self.complain(rows))

    def discard(self, folder: Path) -> None:
        """Remove what a run that did not finish left in a folder.

        Raises
        ------
        FileError
            If there is something by the name of `INCOMPLETE` that is not of this study.
        """
        part = folder / INCOMPLETE
        try:
            names = {path.name for path in part.iterdir() if not path.name.startswith(".")}
            if names and self.page not in names:
                raise FileError("folder", str(part), f"one of an earlier run, with {self.page}")
            shutil.rmtree(part)
        except FileNotFoundError:
            pass
        except OSError as reason:
            allowed = f"a folder to write to ({reason.strerror})"
            raise FileError("folder", str(part), allowed) from None

    def read(self, folder: Path) -> Rows:
        """Return the rows of each table in a folder, none where a table is missing.

        Raises
        ------
        FileError
            If a table is not of this version.
        """
        return self._read(folder)

    def _read(self, *folders: Path) -> Rows:
        """Return the rows of each table, from the first of the folders that has it."""
        found: dict[str, Sequence[Any]] = {}
        for stem, kind in self.tables.items():
            paths = (folder / f"{stem}.csv" for folder in folders)
            path = next((one for one in paths if one.exists()), None)
            found[stem] = read_rows(path, kind) if path else []
        return found

    def finding(self, tables: Rows) -> str:
        """Return what the tables show as one paragraph, empty if there is nothing to say."""
        return pages.prose(pages.block(self.template, "finding", self._values(tables)))

    def _write(
        self,
        folder: Path,
        rows: Sequence[Any],
        entries: Sequence[Mapping[str, Any]],
        seed: int,
        complete: bool,
    ) -> None:
        part = folder / INCOMPLETE
        for place, (stem, kind) in enumerate(self.tables.items()):
            found = [row for row in rows if isinstance(row, kind)]
            if found or place == 0:
                write_text(part / f"{stem}.csv", Table(kind, found).csv())
        if self.entries:
            write_text(part / self.entries, json.dumps(entries, indent=1) + "\n")
        names = {path.name for where in (folder, part) for path in where.glob("*.md")}
        others = sorted(names - {self.page})
        # From the tables as they were written, so that page and tables agree.
        values = {**self._values(self._read(part, folder)), "seed": seed, "complete": complete}
        page = pages.page(self.template, {**values, "others": others})
        write_text(part / self.page, page)

    def _values(self, tables: Rows) -> dict[str, object]:
        named = {stem.replace("-", "_"): rows for stem, rows in tables.items()}
        return {**self.settings, **named, "rows": tables[next(iter(self.tables))]}


def _publish(folder: Path, page: str) -> None:
    """Move the files of a complete result, if there is one, to where they belong."""
    made = folder / COMPLETE
    if not made.is_dir():
        return
    files = [path.relative_to(made) for path in sorted(made.rglob("*")) if path.is_file()]
    files.sort(key=lambda file: str(file) == page)
    if files:
        write_text(folder / page, _REPLACING)
    for file in files:
        write_bytes(prepare_file(folder / file, "output file"), (made / file).read_bytes())
        (made / file).unlink()
    shutil.rmtree(made)
