"""Rows that a command computes one by one: written after each, shown in the end.

The output folder gets two files of all rows, as CSV and as JSON with their provenance, and the
further files that the command gives. Until all rows are there they are in the subfolder
``incomplete``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from lockedjoint.commands.output import INTERRUPTED, Answer, end, fitted, say
from lockedjoint.formulations.io.files import write_json, write_text
from lockedjoint.formulations.io.run_folder import RunFolder
from lockedjoint.formulations.io.table import Table, provenance


class RowsOfRun:
    """Rows on their way into a folder, while the ``with`` statement runs.

    Ctrl-C ends the run there and keeps what is done; another exception leaves nothing.

    Parameters
    ----------
    out
        The output folder.
    name
        Name of the two files of rows, without their endings.
    kind
        Class of the rows: a dataclass that `Table` can show.
    seed
        Seed of the run, for the provenance.
    others
        Names of further files, which `add` is given.

    Raises
    ------
    FileError
        If one of the files cannot be written.
    """

    def __init__(self, out: Path, name: str, kind: type[Any], seed: int, *others: str) -> None:
        self._name, self._kind, self._seed = name, kind, seed
        self._folder = RunFolder.begin(out, f"{name}.json", f"{name}.csv", *others)
        self._beside: dict[str, object] = {}
        self.rows: list[Any] = []
        self.complete = False
        self._write()

    def add(self, row: object, beside: Mapping[str, object] | None = None) -> None:
        """Write one row more, and the further files: their values, as JSON, by their names."""
        self.rows.append(row)
        self._beside = dict(beside or {})
        self._write()

    def __enter__(self) -> RowsOfRun:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        if error is None:
            self.complete = True
            self._write()
            self._folder.publish()
        elif not isinstance(error, KeyboardInterrupt):
            self._folder.discard()
        return isinstance(error, KeyboardInterrupt)

    def show(
        self,
        as_json: bool,
        to: str = "",
        note: str | None = None,
        columns: Sequence[str] | None = None,
    ) -> None:
        """Print what the run gave.

        ``--json`` prints the rows; `to` prints the whole table in a form (markdown, latex or
        csv); else the table for a terminal with the note below, if there is a note, and the
        names of the files. `columns` are as in `as_table`; by default a form has all columns in
        CSV, and else those to read.

        Raises
        ------
        click.exceptions.Exit
            With status 130 if the run was interrupted.
        """
        table: Table[Any] = Table(self._kind, self.rows)
        where = self._folder.folder if self.complete else self._folder.part
        if as_json:
            Answer({"complete": self.complete, "rows": table.plain()}).show(as_json)
        elif self.rows and to:
            forms = {"markdown": table.markdown, "latex": table.latex, "csv": table.csv}
            say(forms[to](columns), nl=to != "csv")
        elif self.rows:
            if note is not None:
                say(f"{fitted(table, columns)}\n\n{note}")
            names = sorted(path.name for path in where.iterdir())
            say(f"Written to {where}: {', '.join(names)}")
        if not self.complete:
            done = f"what was done is in {where}, the rest is missing"
            end(f"Interrupted: {done}.", status=INTERRUPTED)

    def _write(self) -> None:
        """Write all files anew, with the rows so far."""
        part, table = self._folder.part, Table(self._kind, self.rows)
        state = {**provenance(), "seed": self._seed, "complete": self.complete}
        write_json(part / f"{self._name}.json", {**state, "rows": table.plain()})
        if self.rows:
            write_text(part / f"{self._name}.csv", table.csv())
        for file, values in self._beside.items():
            write_json(part / file, values)
