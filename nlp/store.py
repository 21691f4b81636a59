"""Records on disk: one per start, kept as they arrive, never twice.

A store is one SQLite file in write-ahead mode: one process writes, others read meanwhile.
A *cell* is a problem with all that decides its records, and a record is what became of one
start of a cell. Floats are eight-byte floats in the file, so they come back bit for bit. NaN,
which SQL does not have, is kept as NULL. The caller's `Schema` lists the columns.

Every record has a checksum. A store is verified when it is opened: its tables, SQLite's own
structure, then every record. Records that arrive later are verified before the next query reads
them.
"""

import math
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias

from nlp.errors import FileError, InputError
from nlp.store_checks import Damage, plain
from nlp.store_file import StoreFile
from nlp.store_schema import Condition, Schema, Value
from nlp.store_verification import Checksums, Verification
from nlp.store_version import prepare

# Which types the values have, the schema knows.
Row: TypeAlias = dict[str, Any]


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
        schema's version if it is older and there are migrations. One process writes at a time.
    salvage
        Whether to open a store with damaged records. They are left out of all that is read,
        and listed in `damaged`.

    Attributes
    ----------
    checksums
        Whether the records had checksums; an older store that is only read is migrated in a
        temporary copy, where they are computed from what is there.

    Raises
    ------
    FileError
        If it cannot be opened, is not such a store, or its version cannot be read.
    StoreError
        If its structure is damaged, records are and it is not opened to `salvage` the others,
        or another process writes to it.
    """

    def __init__(
        self, path: Path, schema: Schema, *, writable: bool = False, salvage: bool = False
    ) -> None:
        self.path = path
        self.schema = schema
        self._file = StoreFile(path, writable=writable)
        try:
            with self._file.errors():
                self._sums = Checksums(self._file, schema)
                self.checksums = prepare(self._file, schema, self._sums)
                self._verification = Verification(
                    self._file, schema, self._sums, salvage=salvage
                )
                self._verification.update()
        except BaseException:
            self._file.close()
            raise

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        self._file.close()

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """The damaged records by cell, as far as the store has been verified."""
        return self._verification.damaged

    def count(self) -> int:
        """Return the number of records, damaged ones included."""
        with self._file.errors():
            return self._file.value("SELECT count(*) FROM record")

    def cell(self, settings: Mapping[str, Value]) -> int:
        """Return the number of the cell with these settings, made if there is none yet."""
        with self._transaction():
            return self._number("cell", settings)

    def add(
        self, cell: int, records: Sequence[tuple[int, Mapping[str, Value]]], environment: str
    ) -> int:
        """Keep records, all of them or none; those that are there already stay as they are.

        Damaged ones are replaced.

        Parameters
        ----------
        cell
            Number of the cell.
        records
            Start and values of each.
        environment
            What they were made with, such as versions.

        Returns
        -------
        int
            How many were added.
        """
        with self._transaction():
            made = self._number("environment", {"environment": environment})
            return sum(self._insert(cell, made, start, values) for start, values in records)

    def join(self, other: "Store", apart_from: Collection[str] = ()) -> tuple[int, int]:
        """Add the intact records of another store of the same kind, all of them or none.

        Parameters
        ----------
        other
            The other store, which stays as it is.
        apart_from
            Values in which records of one start may differ, such as times.

        Returns
        -------
        tuple of int
            Records that were added, and records that were there already.

        Raises
        ------
        FileError
            If it is the same store.
        InputError
            If both have a record of one start with different values; nothing is added.
        """
        if other.path.samefile(self.path):
            allowed = "another file than the store itself"
            raise FileError("store to join", str(other.path), allowed)
        counts = {True: 0, False: 0}
        cells: dict[int, int] = {}
        environments: dict[str, int] = {}
        with self._transaction():
            for row in other.query("SELECT * FROM chosen ORDER BY cell, start"):
                number, text = row["cell"], row["environment"]
                if number not in cells:
                    settings = {name: row[name] for name in self.schema.settings}
                    cells[number] = self._number("cell", settings)
                if text not in environments:
                    environments[text] = self._number("environment", {"environment": text})
                cell = cells[number]
                added = self._insert(cell, environments[text], row["start"], row)
                if not added:
                    self._refuse_conflict(cell, row, other.path, apart_from)
                counts[added] += 1
        return counts[True], counts[False]

    def missing(self, cell: int, starts: int) -> list[range]:
        """Return the starts below `starts` without an intact record, as ranges in order."""
        select = (
            "SELECT first, start FROM "
            "(SELECT start, lag(start, 1, -1) OVER (ORDER BY start) + 1 AS first FROM "
            "(SELECT start FROM record WHERE cell = ? AND start < ? "
            "AND rowid NOT IN (SELECT id FROM temp.damaged) UNION ALL SELECT ?)) "
            "WHERE first < start ORDER BY start"
        )
        with self._file.errors():
            found = self._file.execute(select, (cell, starts, starts)).fetchall()
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
        self._verification.update()
        clauses = [condition.clause(self.schema) for condition in conditions] or ["true"]
        statement = (
            f"WITH kept AS ({self.schema.records(self._verification.last)}), "
            f"chosen AS (SELECT * FROM kept WHERE {' AND '.join(clauses)}) {select}"
        )
        given = [*(condition.value for condition in conditions), *values]
        kinds = self.schema.columns
        with self._file.errors(), ExitStack() as finished:
            found = self._file.execute(statement, given)
            finished.callback(_end, found)
            names = [column[0] for column in found.description]
            empty = [math.nan if kinds.get(n, "REAL") == "REAL" else None for n in names]
            for line in found:
                read = (e if v is None else v for v, e in zip(line, empty, strict=True))
                yield dict(zip(names, read, strict=True))

    def _insert(
        self, cell: int, environment: int, start: int, values: Mapping[str, Value]
    ) -> bool:
        """Add a record, or replace a damaged one; return whether it is new."""
        names = list(self.schema.values)
        line = [plain(kind, values[name]) for name, kind in self.schema.values.items()]
        checksum = self._sums.of(cell, environment)
        if checksum is None:
            raise InputError("cell", cell, "the number of a cell of the store")
        marks = ", ".join("?" * (len(names) + 4))
        insert = (
            f"INSERT INTO record (cell, start, environment, {', '.join(names)}, checksum) "
            f"VALUES ({marks}) ON CONFLICT (cell, start) DO NOTHING"
        )
        if self._verification.is_damaged(cell, start):
            for table in ("record", "temp.damaged"):
                which = f"DELETE FROM {table} WHERE cell = ? AND start = ?"
                self._file.execute(which, (cell, start))
        kept = (cell, int(start), environment, *line, checksum(int(start), names, line))
        return self._file.execute(insert, kept).rowcount == 1

    def _refuse_conflict(
        self, cell: int, row: Row, other: Path, apart_from: Collection[str]
    ) -> None:
        kinds = {n: k for n, k in self.schema.values.items() if n not in apart_from}
        select = (
            f"SELECT {', '.join(['start', *kinds])} FROM record WHERE cell = ? AND start = ?"
        )
        ours = self._file.execute(select, (cell, row["start"])).fetchone()
        if ours[1:] != tuple(plain(kind, row[name]) for name, kind in kinds.items()):
            identity = (*self.schema.settings, "start")
            record = ", ".join(f"{name}={row[name]}" for name in identity)
            allowed = "records equal to those that are there already, where starts are the same"
            raise InputError(f"record of {record}", f"another one in {other}", allowed)

    def _number(self, table: str, values: Mapping[str, Value]) -> int:
        """Return the number of a table's row with these values, added if it is new."""
        given = tuple(values.values())
        columns, marks = ", ".join(values), ", ".join("?" * len(values))
        same = " AND ".join(f"{name} = ?" for name in values)
        add = f"INSERT INTO {table} ({columns}) VALUES ({marks}) ON CONFLICT DO NOTHING"
        self._file.execute(add, given)
        return self._file.value(f"SELECT id FROM {table} WHERE {same}", given)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        try:
            with self._file.transaction():
                yield
        except BaseException:
            self._sums.forget()  # they may be of rows that are gone
            raise


def _end(found: sqlite3.Cursor) -> None:
    with suppress(sqlite3.ProgrammingError):  # the store was closed before its reader ended
        found.close()
