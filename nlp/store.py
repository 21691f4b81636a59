"""Records on disk: one per start, kept as they arrive, never twice.

A store is one SQLite file in write-ahead mode: one process writes, others read meanwhile.
A *cell* is a problem with all that decides its records, and a record is what became of one
start of a cell. Floats are eight-byte floats in the file, so they come back bit for bit. NaN,
which SQL does not have, is kept as NULL. The caller's `Schema` lists the columns.
"""

import math
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from nlp.errors import FileError, InputError
from nlp.store_schema import Condition, Schema, Value

# Which types the values have, the schema knows.
Row: TypeAlias = dict[str, Any]

_BUSY_SECONDS = 60.0


class Store(AbstractContextManager["Store", None]):
    """An open store; use it in a ``with`` block, or close it.

    Parameters
    ----------
    path
        The file. Its folder must exist.
    schema
        The columns that the caller keeps.
    writable
        Whether to add to it. A writable store is made if there is none, and brought to the
        schema's version if it is older and there are migrations.

    Raises
    ------
    FileError
        If it cannot be opened, is not such a store, or has another version.
    """

    def __init__(self, path: Path, schema: Schema, *, writable: bool = False) -> None:
        self.path = path
        self.schema = schema
        if not writable and not path.is_file():
            raise FileError("store", str(path), "the file of a campaign")
        with self._clear():
            self._database = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode={'rwc' if writable else 'ro'}",
                uri=True,
                timeout=_BUSY_SECONDS,
                isolation_level=None,  # transactions are those of `_transaction` only
            )
            try:
                self._prepare(writable)
            except BaseException:
                self._database.close()
                raise

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        with self._clear():
            self._database.close()

    def cell(self, settings: Mapping[str, Value]) -> int:
        """Return the number of the cell with these settings, made if there is none yet."""
        with self._transaction():
            return self._number("cell", settings)

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
        insert = (
            f"INSERT INTO record (cell, start, environment, {', '.join(names)}) "
            f"VALUES (?, ?, ?{', ?' * len(names)}) ON CONFLICT (cell, start) DO NOTHING"
        )
        with self._transaction():
            made = self._number("environment", {"environment": environment})
            lines = [
                (cell, start, made, *(values[name] for name in names))
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
        Store(other, self.schema).close()  # refuses what is not a store of this version
        if other.samefile(self.path):
            raise FileError("store to join", str(other), "another file than the store itself")
        with self._clear():
            uri = f"{other.absolute().as_uri()}?mode=ro"
            self._database.execute("ATTACH DATABASE ? AS other", (uri,))
        values = ", ".join(self.schema.values)
        try:
            with self._transaction():
                for statement in self.schema.additions():
                    self._database.execute(statement)
                self._refuse_conflicts(other, apart_from)
                added = self._database.execute(
                    f"INSERT INTO main.record (cell, start, environment, {values}) "
                    f"SELECT cell.id, start, environment.id, {values} "
                    f"FROM ({self.schema.records('other')}) "
                    f"JOIN main.cell AS cell USING ({', '.join(self.schema.settings)}) "
                    "JOIN main.environment AS environment USING (environment) "
                    "WHERE true ORDER BY 1, 2 ON CONFLICT (cell, start) DO NOTHING"
                ).rowcount
                theirs = self._value("SELECT count(*) FROM other.record")
        finally:
            self._database.execute("DETACH DATABASE other")
        return added, theirs - added

    def _refuse_conflicts(self, other: Path, apart_from: Collection[str]) -> None:
        compared = [name for name in self.schema.values if name not in apart_from]
        differ = " OR ".join(f"ours.{name} IS NOT theirs.{name}" for name in compared) or "0"
        identity = (*self.schema.settings, "start")
        conflict = self._database.execute(
            f"SELECT {', '.join(identity)} FROM ({self.schema.records()}) AS ours "
            f"JOIN ({self.schema.records('other')}) AS theirs "
            f"USING ({', '.join(identity)}) WHERE {differ} LIMIT 1"
        ).fetchone()
        if conflict is not None:
            pairs = zip(identity, conflict, strict=True)
            record = ", ".join(f"{name}={value}" for name, value in pairs)
            allowed = "records equal to those that are there already, where starts are the same"
            raise InputError(f"record of {record}", f"another one in {other}", allowed)

    def missing(self, cell: int, starts: int) -> list[range]:
        """Return the starts below `starts` without a record, as ranges in order."""
        select = (
            "SELECT first, start FROM "
            "(SELECT start, lag(start, 1, -1) OVER (ORDER BY start) + 1 AS first FROM "
            "(SELECT start FROM record WHERE cell = ? AND start < ? UNION ALL SELECT ?)) "
            "WHERE first < start ORDER BY start"
        )
        with self._clear():
            found = self._database.execute(select, (cell, starts, starts)).fetchall()
        return [range(*gap) for gap in found]

    def rows(
        self, conditions: Sequence[Condition] = (), columns: Sequence[str] | None = None
    ) -> Iterator[Row]:
        """Yield records with their cells' settings, in the order of cells and starts.

        Parameters
        ----------
        conditions
            What records must meet, all of it.
        columns
            Which columns; all by default.

        Raises
        ------
        InputError
            If there is no such column.
        """
        names = list(self.schema.columns if columns is None else columns)
        for name in names:
            self.schema.kind(name)
        select = f"SELECT {', '.join(names)} FROM chosen ORDER BY cell, start"
        return self.query(select, conditions)

    def query(
        self, select: str, conditions: Sequence[Condition] = (), values: Sequence[Value] = ()
    ) -> Iterator[Row]:
        """Yield the rows of a SELECT from ``chosen``, the records that meet all conditions.

        Parameters
        ----------
        select
            The statement. ``chosen`` has all columns of the schema and the number of the
            ``cell``. NULL comes back as NaN in REAL columns and in computed ones.
        conditions
            What records must meet, all of it.
        values
            Values of the question marks in `select`.
        """
        clauses = [condition.clause(self.schema) for condition in conditions] or ["true"]
        statement = (
            f"WITH kept AS ({self.schema.records()}), "
            f"chosen AS (SELECT * FROM kept WHERE {' AND '.join(clauses)}) {select}"
        )
        given = [*(condition.value for condition in conditions), *values]
        kinds = self.schema.columns
        with self._clear(), closing(self._database.execute(statement, given)) as found:
            names = [column[0] for column in found.description]
            empty = [math.nan if kinds.get(n, "REAL") == "REAL" else None for n in names]
            for line in found:
                read = (e if v is None else v for v, e in zip(line, empty, strict=True))
                yield dict(zip(names, read, strict=True))

    def _number(self, table: str, values: Mapping[str, Value]) -> int:
        """Return the number of a table's row with these values, added if it is new."""
        given = tuple(values.values())
        columns, marks = ", ".join(values), ", ".join("?" * len(values))
        same = " AND ".join(f"{name} = ?" for name in values)
        add = f"INSERT INTO {table} ({columns}) VALUES ({marks}) ON CONFLICT DO NOTHING"
        self._database.execute(add, given)
        return int(self._value(f"SELECT id FROM {table} WHERE {same}", given))

    def _value(self, select: str, values: Sequence[Value] = ()) -> int:
        return int(self._database.execute(select, values).fetchone()[0])

    def _prepare(self, writable: bool) -> None:
        """Check that the file is ours and of this version, before anything is changed."""
        version, owner = (
            self._value(f"PRAGMA {n}") for n in ("user_version", "application_id")
        )
        if writable and self._value("SELECT count(*) FROM sqlite_master") == 0:
            with self._transaction():
                for statement in self.schema.creation():
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
        steps = [self.schema.migrations.get(v) for v in range(version, known)]
        if version > known:
            allowed = f"version {known} or older; a newer lockedjoint made it"
        elif None in steps:
            allowed = f"version {known}; this one is too old to be brought up to it"
        elif not writable:
            allowed = f"version {known}; run its campaign again to bring it up to it"
        else:
            with self._transaction():
                for statement in (statement for step in steps for statement in step or ()):
                    self._database.execute(statement)
                self._database.execute(f"PRAGMA user_version = {known}")
            return
        raise FileError("version of the store", version, allowed)

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
