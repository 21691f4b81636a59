"""Records on disk: one SQLite file with one table, one row per start, never two.

A row is keyed by its *cell*, the text of all that decides it, and by its start. Each row has a
digest of its values, so that damaged ones are known. Floats are eight-byte floats in the file
and come back bit for bit; NaN, which SQL does not have, is kept as NULL.

One process writes, others may read meanwhile. What was added is on the disk: a process may be
killed at any moment.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sqlite3
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from lockedjoint.nlp.errors import FileError, InputError, StoreError

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["INTEGER", "REAL", "TEXT", "BLOB"]
Value: TypeAlias = str | int | float | bytes | None

_TYPES: Mapping[Kind, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
_BUSY_SECONDS = 60.0


class Store(AbstractContextManager["Store", None]):
    """An open store; use it in a ``with`` block, or close it.

    Parameters
    ----------
    path
        The file. Its folder must exist.
    columns
        The values of a record, and their kinds.
    application
        Number that marks the file as one of these stores, 32 bits.
    writable
        Whether to add to it. A writable store is made if there is none.
    salvage
        Whether to open a store with damaged records: they are not read, but `damaged`.

    Raises
    ------
    FileError
        If it cannot be opened, or is not such a store.
    StoreError
        If its structure is damaged, or records are and it is not to `salvage` the others; or
        if another process writes to it.
    """

    def __init__(
        self,
        path: Path,
        columns: Mapping[str, Kind],
        application: int,
        *,
        writable: bool = False,
        salvage: bool = False,
    ) -> None:
        self.path = path
        self.columns = dict(columns)
        self._names = ["cell", "start", *self.columns, "environment"]
        self._damaged: dict[int, tuple[object, object]] = {}
        with ExitStack() as opened, self._errors():
            if not (writable or path.is_file()):
                raise FileError("store", str(path), "the file of a campaign")
            # Whoever reads undoes what a killed process had half written, where it may write.
            uri = f"{path.absolute().as_uri()}?mode={'rwc' if writable else 'rw'}"
            how: Any = {"timeout": _BUSY_SECONDS, "isolation_level": None}  # see `_transaction`
            self._database: sqlite3.Connection = sqlite3.connect(uri, uri=True, **how)
            opened.callback(lambda: self._database.close())
            self._database.text_factory = lambda raw: raw.decode(errors="surrogateescape")
            self._execute("PRAGMA trusted_schema = OFF")  # it may come from anybody
            # Also after the power fails: the folder is synchronised when a journal is deleted.
            self._execute("PRAGMA synchronous = EXTRA")
            self._execute("SELECT count(*) FROM sqlite_master")  # SQLite makes the file
            self._file = opened.enter_context(path.open("rb"))
            if writable:
                self._lock()
            self._prepare(application, writable)
            self._verify()
            if self._damaged and not salvage:
                cell, start = self.damaged[0]
                which = f"{len(self._damaged)} damaged records, first start {start} of {cell}"
                raise StoreError("store", str(path), f"one that is intact; it has {which}")
            self._opened = opened.pop_all()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        with self._errors():
            self._opened.close()

    @property
    def damaged(self) -> list[tuple[object, object]]:
        """Cell and start of the damaged records that were not replaced since it was opened."""
        return list(self._damaged.values())

    def add(
        self, cell: str, records: Sequence[tuple[int, Mapping[str, Value]]], environment: str
    ) -> int:
        """Keep records, all of them or none; intact ones that are there stay as they are.

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
            If the file is no longer the one of that name.
        """
        self.check_in_place()
        with self._transaction():
            added = 0
            for start, values in records:
                plain = (_plain(kind, values[name]) for name, kind in self.columns.items())
                added += self._insert((cell, int(start), *plain, environment))
            return added

    def join(self, other: Store, apart_from: Collection[str] = ()) -> tuple[int, int]:
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
        compared = ["start", *(name for name in self.columns if name not in apart_from)]
        places = [self._names.index(name) for name in compared]
        ours = f"SELECT {', '.join(compared)} FROM record WHERE cell = ? AND start = ?"
        with self._transaction():
            for row in other._rows(self._names):
                added = self._insert(row)
                counts[added] += 1
                theirs = tuple(row[place] for place in places)
                if not added and self._execute(ours, row[:2]).fetchone() != theirs:
                    which = f"record of start {row[1]!r} of {row[0]!r}"
                    allowed = "one equal to that which is there already, apart from times"
                    raise InputError(which, f"new in {other.path}", allowed)
        return counts[True], counts[False]

    def missing(self, cell: str, starts: int) -> list[range]:
        """Return the starts below `starts` without an intact record, as ranges in order."""
        select = "SELECT rowid, start FROM record WHERE cell = ? AND start < ? ORDER BY start"
        gaps, first = [], 0
        with self._errors():
            for row, start in self._execute(select, (cell, starts)):
                if row not in self._damaged:
                    gaps.append(range(first, start))
                    first = start + 1
        return [gap for gap in (*gaps, range(first, starts)) if gap]

    def frame(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return the intact records; cells as they were begun, starts in order.

        Parameters
        ----------
        columns
            Which columns besides ``cell`` and ``start``; all, and ``environment``, by default.
        """
        import pandas as pd

        wanted = self._names[2:] if columns is None else columns
        select = (
            f"SELECT {_listed('cell', 'start', *wanted)} FROM record "
            "WHERE rowid NOT IN (SELECT value FROM json_each(?)) "
            "ORDER BY min(rowid) OVER (PARTITION BY cell), start"
        )
        kinds = {name: float for name in wanted if self.columns.get(name) == "REAL"}
        with self._errors():
            values = [json.dumps(list(self._damaged))]
            return pd.read_sql_query(select, self._database, params=values).astype(kinds)

    def check_in_place(self) -> None:
        """Raise StoreError unless the open file is still the file of its name."""
        with suppress(OSError):
            if os.path.samestat(os.fstat(self._file.fileno()), self.path.stat()):
                return
        raise StoreError("store", str(self.path), "a file that nobody removes or replaces")

    def _rows(self, names: Sequence[str]) -> Iterator[tuple[Value, ...]]:
        """Yield the intact rows, in the order in which they were added."""
        select = f"SELECT rowid, {_listed(*names)} FROM record ORDER BY rowid"
        with self._errors():
            for number, *row in self._execute(select):
                if number not in self._damaged:
                    yield tuple(row)

    def _verify(self) -> None:
        """Find damaged records: a value of another kind, or a digest that does not match."""
        kinds: list[Kind] = ["TEXT", "INTEGER", *self.columns.values(), "TEXT"]
        damaged = dict[int, tuple[object, object]]()
        for number, *row, digest in self._rows(["rowid", *self._names, "digest"]):
            fit = all(_fits(kind, value) for value, kind in zip(row, kinds, strict=True))
            if not fit or _digest(row) != digest:
                damaged[int(number or 0)] = (row[0], row[1])
        self._damaged = damaged

    def _insert(self, row: Sequence[Value]) -> bool:
        """Add a row, or replace a damaged one; return whether it is new."""
        same = "SELECT rowid FROM record WHERE cell = ? AND start = ?"
        known = self._execute(same, row[:2]).fetchone()
        if known is not None and self._damaged.pop(known[0], None) is None:
            return False
        places = ", ".join("?" * (len(row) + 1))
        self._execute(f"INSERT OR REPLACE INTO record VALUES ({places})", (*row, _digest(row)))
        return True

    def _prepare(self, application: int, writable: bool) -> None:
        """Make the table of a new file; refuse a file with other tables, or none of ours."""
        columns = ", ".join(f'"{name}" {kind}' for name, kind in self.columns.items())
        table = (
            f"CREATE TABLE record (cell TEXT NOT NULL, start INTEGER NOT NULL, {columns}, "
            "environment TEXT NOT NULL, digest BLOB NOT NULL, PRIMARY KEY (cell, start))"
        )
        listed = "SELECT sql FROM sqlite_master WHERE sql NOTNULL"
        if writable and not self._execute(listed).fetchall():
            with self._transaction():
                self._execute(table)
                self._execute(f"PRAGMA application_id = {application}")
        if self._execute("PRAGMA application_id").fetchone()[0] != application:
            raise FileError("store", str(self.path), "the file of a campaign of this version")
        if self._execute(listed).fetchall() != [(table,)]:
            raise StoreError("store", str(self.path), "one that is intact (other tables)")
        state = self._execute("PRAGMA integrity_check(1)").fetchone()[0]
        if state != "ok":
            raise StoreError("store", str(self.path), f"one that is intact ({state})")
        if writable:
            with self._transaction():  # better refused now than after hours of work
                self._execute(f"PRAGMA application_id = {application}")

    def _lock(self) -> None:
        """Refuse a second process that writes; the system frees the lock when one ends.

        SQLite's own locks are those of a transaction. Its mode for one process is for Windows.
        """
        if sys.platform == "win32":
            for statement in ("PRAGMA locking_mode = EXCLUSIVE", "BEGIN IMMEDIATE", "COMMIT"):
                self._execute(statement)
            return
        import fcntl

        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            allowed = "one that no other process writes"
            raise StoreError("store", str(self.path), allowed) from None

    def _execute(self, statement: str, values: Sequence[Value] = ()) -> sqlite3.Cursor:
        return self._database.execute(statement, values)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """Write all that is executed in the block, or nothing of it."""
        before = dict(self._damaged)
        with self._errors():
            self._execute("BEGIN IMMEDIATE")
            try:
                yield
                self._execute("COMMIT")
            except BaseException:
                if self._database.in_transaction:  # SQLite may have rolled back by itself
                    self._execute("ROLLBACK")
                self._damaged = before
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
            elif "full" in said or "disk I/O" in said:
                allowed = f"a file on a disk with room ({said}); what it holds is kept"
            raise kind("store", str(self.path), allowed) from None


def _listed(*names: str) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _fits(kind: Kind, value: Value) -> bool:
    """Whether a value of the file is of its column's kind, or NULL; text must be in UTF-8."""
    if isinstance(value, str) and not value.isascii():
        return kind == "TEXT" and value.encode(errors="ignore").decode() == value
    return value is None or type(value) is _TYPES[kind]


def _digest(row: Sequence[Value]) -> bytes:
    # `ascii` of these types is the same in every version of Python, and exact.
    return hashlib.blake2b(ascii(tuple(row)).encode(), digest_size=16).digest()


def _plain(kind: Kind, value: Any) -> Value:
    """Return a value as it comes back from a column of this kind; NaN as None."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    return _TYPES[kind](value)  # type: ignore[no-any-return]
