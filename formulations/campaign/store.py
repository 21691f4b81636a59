"""Records on disk: one SQLite file with one table, one row per start, never two.

A row is keyed by its *cell*, the text of all that decides it, and by its start. Each row has a
digest of its values: a store with a row that does not match its digest is refused. Floats are
eight-byte floats in the file and come back bit for bit; NaN, which SQL does not have, is kept
as NULL.

What was added is on the disk: a process may be killed at any moment. Several processes may read
and add at the same time.
"""

from __future__ import annotations

import hashlib
import math
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.errors import FileError, InputError, StoreError

if TYPE_CHECKING:
    import pandas as pd

#: Kinds of columns, by SQL's names.
ColumnType = Literal["INTEGER", "REAL", "TEXT", "BLOB"]
#: A value of a record.
Value: TypeAlias = str | int | float | bytes | None

# What a value of each kind is in Python.
_TYPES: Mapping[ColumnType, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
# Seconds to wait until another process has kept what it adds.
_BUSY_SECONDS = 60.0
# Number of bytes of a digest.
_DIGEST_BYTES = 16
# Number of damaged rows that an error lists.
_MOST_LISTED = 20


class Store(AbstractContextManager["Store", None]):
    """An open store; use it in a ``with`` block, or close it.

    Parameters
    ----------
    path
        The file. Its folder must exist.
    columns
        The values of a record, and their kinds.
    writable
        Whether to add to it. A writable store is made if there is none.

    Raises
    ------
    FileError
        If it cannot be opened, or is no SQLite file.
    StoreError
        If it has other tables, or if its structure or a record is damaged.
    """

    def __init__(
        self, path: Path, columns: Mapping[str, ColumnType], *, writable: bool = False
    ) -> None:
        self.path = path
        self.columns = dict(columns)
        self._names = ["cell", "start", *self.columns, "environment"]
        with ExitStack() as opened, self._errors():
            if not (writable or path.is_file()):
                raise FileError("store", str(path), "the file of a campaign (no such file)")
            # A reader, too, undoes what a killed process wrote by half, where it may write.
            uri = f"{path.absolute().as_uri()}?mode={'rwc' if writable else 'rw'}"
            # Transactions are those of `_transaction` if there is no isolation level.
            self._database = sqlite3.connect(
                uri, uri=True, timeout=_BUSY_SECONDS, isolation_level=None
            )
            opened.callback(self._database.close)
            self._database.text_factory = lambda raw: raw.decode(errors="surrogateescape")
            self._execute("PRAGMA trusted_schema = OFF")  # the file may come from anybody
            # Also after the power fails: the folder is synchronised when a journal is deleted.
            self._execute("PRAGMA synchronous = EXTRA")
            self._check_table(writable)
            self._check_records()
            opened.pop_all()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        with self._errors():
            self._database.close()

    def add(
        self, cell: str, records: Sequence[tuple[int, Mapping[str, Value]]], environment: str
    ) -> int:
        """Keep records, all of them or none; those that are there stay as they are.

        Parameters
        ----------
        cell
            What decides the records.
        records
            Start and values of each.
        environment
            What they were made with, such as versions.

        Returns
        -------
        int
            How many were added.

        Raises
        ------
        StoreError
            If the file was removed meanwhile.
        """
        places = ", ".join("?" * (len(self._names) + 1))
        insert = f"INSERT INTO record VALUES ({places}) ON CONFLICT (cell, start) DO NOTHING"
        with self._transaction():
            if not self.path.is_file():
                raise StoreError("store", str(self.path), "a file that nobody removes")
            added = 0
            for start, values in records:
                plain = [_plain(kind, values[name]) for name, kind in self.columns.items()]
                row = (cell, int(start), *plain, environment)
                added += self._execute(insert, (*row, _digest(row))).rowcount
            return added

    def join(self, other: Store, apart_from: Collection[str] = ()) -> tuple[int, int]:
        """Add the records of another store of the same kind, all of them or none.

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
        compared = [name for name in self.columns if name not in apart_from]
        differ = " OR ".join(f'ours."{name}" IS NOT theirs."{name}"' for name in compared)
        contradiction = (
            "SELECT cell, start FROM main.record AS ours JOIN other.record AS theirs "
            f"USING (cell, start) WHERE {differ or 'FALSE'} LIMIT 1"
        )
        insert = (
            "INSERT INTO main.record SELECT * FROM other.record WHERE TRUE ORDER BY rowid "
            "ON CONFLICT (cell, start) DO NOTHING"
        )
        with self._attached(other), self._transaction():
            if row := self._execute(contradiction).fetchone():
                which = f"record of start {row[1]!r} of {row[0]!r}"
                allowed = "one equal to that which is there already, apart from times"
                raise InputError(which, f"new in {other.path}", allowed)
            added = self._execute(insert).rowcount
            count = self._execute("SELECT count(*) FROM other.record").fetchone()[0]
            return added, count - added

    def missing(self, cell: str, starts: int) -> list[range]:
        """Return the starts below `starts` without a record, as ranges in order."""
        select = "SELECT start FROM record WHERE cell = ? AND start < ? ORDER BY start"
        gaps, first = [], 0
        with self._errors():
            for (start,) in self._execute(select, (cell, starts)):
                gaps.append(range(first, start))
                first = start + 1
        return [gap for gap in (*gaps, range(first, starts)) if gap]

    def frame(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return the records; cells as they were begun, starts in order.

        MissingLibraryError without pandas.

        Parameters
        ----------
        columns
            Which columns besides ``cell`` and ``start``; all, and ``environment``, by default.
        """
        library("pandas")
        import pandas as pd

        wanted = self._names[2:] if columns is None else columns
        select = (
            f"SELECT {_listed('cell', 'start', *wanted)} FROM record "
            "ORDER BY min(rowid) OVER (PARTITION BY cell), start"
        )
        kinds = {name: float for name in wanted if self.columns.get(name) == "REAL"}
        with self._errors():
            return pd.read_sql_query(select, self._database).astype(kinds)

    def _check_table(self, writable: bool) -> None:
        """Make the table of a new file; refuse a file with other tables, or a damaged one."""
        columns = ", ".join(f'"{name}" {kind}' for name, kind in self.columns.items())
        table = (
            f"CREATE TABLE record (cell TEXT NOT NULL, start INTEGER NOT NULL, {columns}, "
            "environment TEXT NOT NULL, digest BLOB NOT NULL, PRIMARY KEY (cell, start))"
        )
        listed = "SELECT sql FROM sqlite_master WHERE sql NOTNULL"
        if writable:
            with self._transaction():
                if not self._execute(listed).fetchall():
                    self._execute(table)
        if self._execute(listed).fetchall() != [(table,)]:
            raise StoreError("store", str(self.path), "one that is intact (other tables)")
        state = self._execute("PRAGMA integrity_check(1)").fetchone()[0]
        if state != "ok":
            raise StoreError("store", str(self.path), f"one that is intact ({state})")
        if writable:
            # A file that cannot be written is refused now, not after hours of work.
            with self._transaction():
                self._execute("PRAGMA user_version = 1")

    def _check_records(self) -> None:
        """Refuse damaged records: a value of another kind, or a digest that does not match."""
        kinds: list[ColumnType] = ["TEXT", "INTEGER", *self.columns.values(), "TEXT"]
        damaged: list[tuple[Any, Any, Any]] = []
        select = f"SELECT rowid, {_listed(*self._names, 'digest')} FROM record ORDER BY rowid"
        for number, *row, digest in self._execute(select):
            fit = all(_fits(kind, value) for value, kind in zip(row, kinds, strict=True))
            if not fit or _digest(row) != digest:
                damaged.append((number, row[0], row[1]))
        if damaged:
            _, cell, start = damaged[0]
            numbers = ", ".join(str(number) for number, *_ in damaged[:_MOST_LISTED])
            allowed = (
                f"one that is intact; it has {len(damaged)} damaged records, first start "
                f"{start} of {cell}; in SQL, DELETE FROM record WHERE rowid IN ({numbers}) "
                "takes them out"
            )
            raise StoreError("store", str(self.path), allowed)

    def _execute(self, statement: str, values: Sequence[Value] = ()) -> sqlite3.Cursor:
        """Execute a statement of SQL, with values in the places of its question marks."""
        return self._database.execute(statement, values)

    @contextmanager
    def _attached(self, other: Store) -> Iterator[None]:
        """Read another store as the schema ``other``."""
        with self._errors():
            self._execute("ATTACH ? AS other", (f"{other.path.absolute().as_uri()}?mode=ro",))
            try:
                yield
            finally:
                self._execute("DETACH other")

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """Write all that is executed in the block, or nothing of it."""
        with self._errors():
            self._execute("BEGIN IMMEDIATE")
            try:
                yield
                self._execute("COMMIT")
            except BaseException:
                if self._database.in_transaction:  # SQLite may have rolled back by itself
                    self._execute("ROLLBACK")
                raise

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Turn errors of SQLite and of the system into one sentence."""
        try:
            yield
        except InputError:
            raise
        except (sqlite3.Error, OSError, ValueError, OverflowError) as reason:
            said = getattr(reason, "strerror", None) or str(reason)
            code = int(getattr(reason, "sqlite_errorcode", 0)) & 0xFF
            kind: type[FileError] = FileError
            allowed = f"the file of a campaign, in a folder to write to ({said})"
            if code in (sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT):
                kind, allowed = StoreError, f"one that is intact ({said})"
            elif code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
                allowed = f"a file on a disk with room ({said}); what it holds is kept"
            raise kind("store", str(self.path), allowed) from None


def _listed(*names: str) -> str:
    """Return names of columns as SQL has them, quoted and separated by commas."""
    return ", ".join(f'"{name}"' for name in names)


def _fits(kind: ColumnType, value: Value) -> bool:
    """Whether a value of the file is of its column's kind, or NULL; text must be in UTF-8."""
    if isinstance(value, str) and not value.isascii():
        return kind == "TEXT" and value.encode(errors="ignore").decode() == value
    return value is None or type(value) is _TYPES[kind]


def _digest(row: Sequence[Value]) -> bytes:
    """Return the digest of a row's values, without the digest itself."""
    # `ascii` of these types is the same in every version of Python, and exact.
    text = ascii(tuple(row)).encode()
    return hashlib.blake2b(text, digest_size=_DIGEST_BYTES).digest()


def _plain(kind: ColumnType, value: Any) -> Value:
    """Return a value as it comes back from a column of this kind; NaN as None."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    return _TYPES[kind](value)  # type: ignore[no-any-return]
