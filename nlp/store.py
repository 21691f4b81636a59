"""Records on disk: one per start, kept as they arrive, never twice.

A store is one SQLite file in write-ahead mode: one process writes, others read meanwhile.
A *cell* is a problem with all that decides its records, and a record is what became of one
start of a cell. Floats are eight-byte floats in the file, so they come back bit for bit; NaN,
which SQL does not have, is kept as NULL. The caller's `Schema` says which columns there are.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self, TypeAlias

from nlp.errors import FileError, InputError
from nlp.store_join import conflict_query, join_statements
from nlp.store_schema import Condition, Schema, Value, create_statements, from_sql, to_sql

Row: TypeAlias = dict[str, Value]

_BUSY_SECONDS = 60.0


class Store:
    """An open store; use it in a ``with`` block, or close it.

    Parameters
    ----------
    path
        The file. Its folder must exist.
    schema
        The columns that the caller keeps.
    writable
        Whether to add to it; a writable store is made if there is none, and brought to the
        schema's version if an older one can be.

    Raises
    ------
    FileError
        If it cannot be opened, is not such a store, or has another version.
    """

    def __init__(self, path: Path, schema: Schema, *, writable: bool = False) -> None:
        self.path = path
        self.schema = schema
        with self._clear():
            mode = "rwc" if writable else "ro"
            if not writable and not path.is_file():
                raise FileError("store", str(path), "the file of a campaign")
            self._database = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={mode}",
                uri=True,
                timeout=_BUSY_SECONDS,
                isolation_level=None,  # transactions begin and end where it is said below
            )
        try:
            with self._clear():
                self._prepare(writable)
        except BaseException:
            self._database.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is there already."""
        with self._clear():
            self._database.close()

    def cell(self, settings: Mapping[str, Value]) -> int:
        """Return the number of the cell with these settings, made if there is none yet."""
        names = list(self.schema.settings)
        if set(settings) != set(names):
            raise InputError("settings", sorted(settings), ", ".join(names))
        values = [to_sql(settings[name]) for name in names]
        columns, marks = ", ".join(names), ", ".join("?" * len(names))
        matches = " AND ".join(f"{name} = ?" for name in names)
        with self._transaction():
            self._database.execute(
                f"INSERT INTO cell ({columns}) VALUES ({marks}) ON CONFLICT DO NOTHING", values
            )
            found = self._database.execute(f"SELECT id FROM cell WHERE {matches}", values)
            return int(found.fetchone()[0])

    def add(
        self, cell: int, records: Sequence[tuple[int, Mapping[str, Value]]], environment: str
    ) -> None:
        """Keep records, all of them or none; those that are there already stay as they are.

        Parameters
        ----------
        cell
            Number of the cell.
        records
            Start and values of each.
        environment
            What they were made with, such as versions.
        """
        names = list(self.schema.values)
        columns, marks = ", ".join(names), ", ".join("?" * (len(names) + 3))
        insert = (
            f"INSERT INTO record (cell, start, environment, {columns}) VALUES ({marks}) "
            "ON CONFLICT (cell, start) DO NOTHING"
        )
        with self._transaction():
            number = self._environment(environment)
            lines = [
                [cell, start, number, *(to_sql(values[name]) for name in names)]
                for start, values in records
            ]
            self._database.executemany(insert, lines)

    def join(self, other: Path, apart_from: Collection[str] = ()) -> tuple[int, int]:
        """Add the records of another store of the same kind, all of them or none.

        Parameters
        ----------
        other
            Its file, which stays as it is.
        apart_from
            Values in which records of one start may differ, such as times.

        Returns
        -------
        tuple of int
            Records that were added, and records that were there already.

        Raises
        ------
        FileError
            If it is not such a store, has another version or is this one.
        InputError
            If both have a record of one start with different values; nothing is added.
        """
        with Store(other, self.schema):  # refuses what is not a store of this version
            pass
        if other.samefile(self.path):
            raise FileError("store to join", str(other), "another file than the store itself")
        with self._clear():
            uri = f"{other.absolute().as_uri()}?mode=ro"
            self._database.execute("ATTACH DATABASE ? AS other", (uri,))
        try:
            with self._transaction():
                self._refuse_conflicts(other, apart_from)
                added = [
                    self._database.execute(s).rowcount for s in join_statements(self.schema)
                ]
                count = "SELECT count(*) FROM other.record"
                theirs = int(self._database.execute(count).fetchone()[0])
        finally:
            self._database.execute("DETACH DATABASE other")
        return added[-1], theirs - added[-1]

    def _refuse_conflicts(self, other: Path, apart_from: Collection[str]) -> None:
        found = self._database.execute(conflict_query(self.schema, apart_from)).fetchone()
        if found is None:
            return
        names = (*self.schema.settings, "start")
        record = ", ".join(f"{name}={value}" for name, value in zip(names, found, strict=True))
        allowed = "records equal to those that are there already, where starts are the same"
        raise InputError(f"record of {record}", f"another one in {other}", allowed)

    def missing(self, cell: int, starts: int) -> list[range]:
        """Return the starts below `starts` without a record, as ranges in order."""
        gaps: list[range] = []
        expected = 0
        select = "SELECT start FROM record WHERE cell = ? AND start < ? ORDER BY start"
        with self._clear(), closing(self._database.execute(select, (cell, starts))) as found:
            for (start,) in found:
                if start > expected:
                    gaps.append(range(expected, start))
                expected = start + 1
        return [*gaps, range(expected, starts)] if expected < starts else gaps

    def rows(
        self,
        conditions: Sequence[Condition] = (),
        columns: Sequence[str] | None = None,
        *,
        order: str | None = None,
        descending: bool = False,
    ) -> Iterator[Row]:
        """Yield records with their cells' settings, in the order of cells and starts.

        Parameters
        ----------
        conditions
            What records must meet, all of it.
        columns
            Which columns; all by default.
        order, descending
            A column to order by first.

        Raises
        ------
        InputError
            If there is no such column.
        """
        first = "" if order is None else self.schema.qualified(order)
        ordered = f"{first}{' DESC' if descending else ''}, " if first else ""
        chosen = list(self.schema.columns if columns is None else columns)
        return self._rows(chosen, conditions, f"ORDER BY {ordered}record.cell, record.start")

    def distinct(
        self, columns: Sequence[str], conditions: Sequence[Condition] = ()
    ) -> Iterator[Row]:
        """Yield each combination of settings that records have, in the order of cells."""
        first = "GROUP BY " + ", ".join(self.schema.qualified(name) for name in columns)
        return self._rows(list(columns), conditions, f"{first} ORDER BY min(record.cell)")

    def _rows(
        self, chosen: Sequence[str], conditions: Sequence[Condition], ending: str
    ) -> Iterator[Row]:
        kinds = [self.schema.kind(name) for name in chosen]
        clauses = [condition.clause(self.schema) for condition in conditions]
        listed = ", ".join(self.schema.qualified(name) for name in chosen)
        query = (
            f"SELECT {listed} FROM record JOIN cell ON cell.id = record.cell "
            "JOIN environment ON environment.id = record.environment "
            + ("WHERE " + " AND ".join(clauses) if clauses else "")
            + f" {ending}"
        )
        values = [condition.value for condition in conditions]
        with self._clear(), closing(self._database.execute(query, values)) as found:
            for line in found:
                read = (from_sql(kind, value) for kind, value in zip(kinds, line, strict=True))
                yield dict(zip(chosen, read, strict=True))

    def _environment(self, text: str) -> int:
        add = "INSERT INTO environment (environment) VALUES (?) ON CONFLICT DO NOTHING"
        self._database.execute(add, (text,))
        select = "SELECT id FROM environment WHERE environment = ?"
        return int(self._database.execute(select, (text,)).fetchone()[0])

    def _prepare(self, writable: bool) -> None:
        """Check that the file is ours and of this version, before anything is changed."""
        version, owner = self._pragma("user_version"), self._pragma("application_id")
        tables = self._database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables == 0 and writable:
            with self._transaction():
                for statement in create_statements(self.schema):
                    self._database.execute(statement)
        elif owner != self.schema.application:
            raise FileError("store", str(self.path), "the file of a campaign")
        elif version != self.schema.version:
            self._migrate(version, writable)
        if writable:
            # The file must survive a crash of the machine as it survives one of the process.
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = FULL")

    def _migrate(self, version: int, writable: bool) -> None:
        known = self.schema.version
        if version > known:
            allowed = f"version {known} or older; a newer lockedjoint made it"
            raise FileError("version of the store", version, allowed)
        steps = [self.schema.migrations.get(v) for v in range(version, known)]
        if None in steps:
            allowed = f"version {known}; this one is too old to be brought up to it"
            raise FileError("version of the store", version, allowed)
        if not writable:
            allowed = f"version {known}; run its campaign again to bring it up to it"
            raise FileError("version of the store", version, allowed)
        with self._transaction():
            for step in steps:
                for statement in step or ():
                    self._database.execute(statement)
            self._database.execute(f"PRAGMA user_version = {known}")

    def _pragma(self, name: str) -> int:
        return int(self._database.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._clear():
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._database.execute("COMMIT")
            except BaseException:
                if self._database.in_transaction:  # SQLite may have rolled back by itself
                    self._database.execute("ROLLBACK")
                raise

    @contextmanager
    def _clear(self) -> Iterator[None]:
        """Turn SQLite's errors into one sentence."""
        try:
            yield
        except sqlite3.Error as reason:
            raise FileError("store", str(self.path), _advice(reason)) from None


def _advice(reason: sqlite3.Error) -> str:
    if "full" in str(reason) or "disk I/O" in str(reason):
        return f"a file on a disk with room ({reason}); what it holds is kept, run again"
    if "locked" in str(reason):
        return f"a file that no other process writes to for long ({reason})"
    return f"the file of a campaign, in a folder to write to ({reason})"
