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
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

from nlp.errors import FileError, InputError, StoreError
from nlp.store_checks import Checksum, Damage, fits, plain, sentence
from nlp.store_lock import WriterLock
from nlp.store_schema import Condition, Kind, Schema, Value

# Which types the values have, the schema knows.
Row: TypeAlias = dict[str, Any]

_BUSY_SECONDS = 60.0
_HEAD = 1 << 16  # bytes of the largest page, the first of which lists the tables
# SQLite's codes for a file that has not the tables that it should have.
_DAMAGE = (sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT)


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
        self.checksums = True
        self._verified = 0  # row of the last record that was verified
        self._salvage = salvage
        self._begun: dict[tuple[int, int], Checksum] = {}
        if not writable and not _is_file(path):
            raise FileError("store", str(path), "the file of a campaign")
        with ExitStack() as opened, self._clear():
            if writable:
                self._lock = WriterLock(path)
                opened.callback(self._lock.release)
            else:
                opened.callback(self._remove_empty_log)
            self._database = self._connected(writable)
            opened.callback(lambda: self._database.close())
            if writable:
                opened.callback(self._empty_log)
            self._prepare(writable)
            self._check_tables()
            self._check_pages()
            self._verify()
            self._opened = opened.pop_all()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        with self._clear():
            self._opened.close()

    def _empty_log(self) -> None:
        """Bring what is in the log into the file, so that the file is all there is."""
        with suppress(sqlite3.OperationalError):  # others read the log
            self._database.execute("PRAGMA busy_timeout = 100")
            self._database.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def _beside(self, ending: str) -> Path:
        """Return a file of SQLite's; it is beside what a link leads to."""
        whole = self.path.resolve()
        return whole.with_name(whole.name + ending)

    def _remove_empty_log(self) -> None:
        """Have SQLite remove the empty log that it made to read the store.

        It does when the last connection that could write is closed: not while others read or
        write. There is nothing in the log that this connection could bring into the file.
        """
        with suppress(OSError, sqlite3.Error):
            if (
                self._beside("-wal").stat().st_size == 0
                and not self._beside("-journal").exists()
            ):
                uri = f"{self.path.absolute().as_uri()}?mode=rw"
                with closing(sqlite3.connect(uri, uri=True, timeout=0)) as writing:
                    writing.execute("PRAGMA schema_version").fetchone()

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """The damaged records by cell, as far as the store has been verified."""
        select = "SELECT cell, start FROM temp.damaged ORDER BY cell, start"
        with self._clear():
            found = self._database.execute(select).fetchall()
            return tuple(
                Damage(cell, self._settings(cell), tuple(start for _, start in members))
                for cell, members in groupby(found, key=itemgetter(0))
            )

    def count(self) -> int:
        """Return the number of records, damaged ones included."""
        with self._clear():
            return self._value("SELECT count(*) FROM record")

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

    def _insert(
        self, cell: int, environment: int, start: int, values: Mapping[str, Value]
    ) -> bool:
        """Add a record, or replace a damaged one; return whether it is new."""
        names = list(self.schema.values)
        line = [plain(kind, values[name]) for name, kind in self.schema.values.items()]
        checksum = self._checksum(cell, environment)
        if checksum is None:
            raise InputError("cell", cell, "the number of a cell of the store")
        marks = ", ".join("?" * (len(names) + 4))
        insert = (
            f"INSERT INTO record (cell, start, environment, {', '.join(names)}, checksum) "
            f"VALUES ({marks}) ON CONFLICT (cell, start) DO NOTHING"
        )
        for table in ("record", "temp.damaged") if self._is_damaged(cell, start) else ():
            which = f"DELETE FROM {table} WHERE cell = ? AND start = ?"
            self._database.execute(which, (cell, start))
        kept = (cell, int(start), environment, *line, checksum(int(start), names, line))
        return self._database.execute(insert, kept).rowcount == 1

    def _is_damaged(self, cell: int, start: int) -> bool:
        select = "SELECT count(*) FROM temp.damaged WHERE cell = ? AND start = ?"
        return self._value(select, (cell, start)) > 0

    def _refuse_conflict(
        self, cell: int, row: Row, other: Path, apart_from: Collection[str]
    ) -> None:
        kinds = {n: k for n, k in self.schema.values.items() if n not in apart_from}
        select = (
            f"SELECT {', '.join(['start', *kinds])} FROM record WHERE cell = ? AND start = ?"
        )
        ours = self._database.execute(select, (cell, row["start"])).fetchone()
        if ours[1:] != tuple(plain(kind, row[name]) for name, kind in kinds.items()):
            identity = (*self.schema.settings, "start")
            record = ", ".join(f"{name}={row[name]}" for name in identity)
            allowed = "records equal to those that are there already, where starts are the same"
            raise InputError(f"record of {record}", f"another one in {other}", allowed)

    def missing(self, cell: int, starts: int) -> list[range]:
        """Return the starts below `starts` without an intact record, as ranges in order."""
        select = (
            "SELECT first, start FROM "
            "(SELECT start, lag(start, 1, -1) OVER (ORDER BY start) + 1 AS first FROM "
            "(SELECT start FROM record WHERE cell = ? AND start < ? "
            "AND rowid NOT IN (SELECT id FROM temp.damaged) UNION ALL SELECT ?)) "
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
        self._verify()
        clauses = [condition.clause(self.schema) for condition in conditions] or ["true"]
        statement = (
            f"WITH kept AS ({self.schema.records(self._verified)}), "
            f"chosen AS (SELECT * FROM kept WHERE {' AND '.join(clauses)}) {select}"
        )
        given = [*(condition.value for condition in conditions), *values]
        kinds = self.schema.columns
        with self._clear(), ExitStack() as finished:
            found = self._database.execute(statement, given)
            finished.callback(_end, found)
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

    def _settings(self, cell: object) -> Row | None:
        names = list(self.schema.settings)
        select = f"SELECT {', '.join(names)} FROM cell WHERE id = ?"
        found = self._database.execute(select, (cell,)).fetchone()
        return None if found is None else dict(zip(names, found, strict=True))

    def _checksum(self, cell: int, environment: int) -> Checksum | None:
        """Return what computes the checksums of such records; None if there is no such row."""
        key = (cell, environment)
        if key not in self._begun:
            settings = self._settings(cell)
            select = "SELECT environment FROM environment WHERE id = ?"
            text = self._database.execute(select, (environment,)).fetchone()
            if settings is None or text is None:
                return None
            kinds: list[Kind] = [*self.schema.settings.values(), "TEXT"]
            if not all(map(fits, kinds, (*settings.values(), *text))):
                return None
            self._begun[key] = Checksum(list(settings.values()), text[0])
        return self._begun[key]

    def _check_tables(self) -> None:
        """Refuse a file with other tables or columns, and with triggers or views."""
        select = "SELECT name, type FROM main.sqlite_master WHERE name NOT LIKE 'sqlite_%'"
        with self._clear():
            found: dict[str, object] = dict(self._database.execute(select).fetchall())
            for table in found:
                columns = self._database.execute(
                    "SELECT name, type FROM pragma_table_xinfo(?, 'main') WHERE NOT hidden",
                    (table,),
                )
                if found[table] == "table":
                    found[table] = dict(columns.fetchall())
        if found != self.schema.tables():
            raise StoreError("store", str(self.path), "one that is intact (other tables)")

    def _check_pages(self) -> None:
        """Refuse a file whose structure is damaged: which records it has is not known then."""
        found = self._database.execute("PRAGMA main.integrity_check(1)").fetchone()[0]
        if found != "ok":
            raise StoreError("store", str(self.path), f"one that is intact ({found})")

    def _verify(self) -> None:
        """Verify the records that came since the last time; the damaged go into a table."""
        names = list(self.schema.values)
        select = (
            f"SELECT rowid, cell, environment, start, checksum, {', '.join(names)} "
            "FROM main.record WHERE rowid > ? ORDER BY rowid"
        )
        kinds: list[Kind] = ["INTEGER", *self.schema.values.values()]
        damaged = []
        with self._clear():
            for row in self._database.execute(select, (self._verified,)):
                self._verified, cell, environment, start, kept, *values = row
                checksum = self._checksum(cell, environment)
                same = checksum is not None and checksum(start, names, values) == kept
                if not (same and all(map(fits, kinds, (start, *values)))):
                    damaged.append((self._verified, cell, start))
            if damaged:
                insert = "INSERT INTO temp.damaged (id, cell, start) VALUES (?, ?, ?)"
                self._database.executemany(insert, damaged)
                if not self._salvage:
                    allowed = f"one whose records are intact; it has {sentence(self.damaged)}"
                    raise StoreError("store", str(self.path), allowed)

    def _connected(self, writable: bool) -> sqlite3.Connection:
        def connect(how: str) -> sqlite3.Connection:
            opened = sqlite3.connect(
                f"{self.path.absolute().as_uri()}?{how}",
                uri=True,
                timeout=_BUSY_SECONDS,
                isolation_level=None,  # transactions are those of `_transaction` only
            )
            opened.text_factory = _text
            opened.execute("PRAGMA trusted_schema = OFF")  # it may come from anybody
            try:
                opened.execute("PRAGMA schema_version").fetchone()  # reads the file
            except BaseException:
                opened.close()
                raise
            return opened

        try:
            return connect(f"mode={'rwc' if writable else 'ro'}")
        except sqlite3.OperationalError as reason:
            # In a folder that is not writable, SQLite cannot make the files of its log.
            if writable or _code(reason) not in (
                sqlite3.SQLITE_CANTOPEN,
                sqlite3.SQLITE_READONLY,
            ):
                raise
            log = self._beside("-wal")
            if log.exists() and log.stat().st_size:
                allowed = (
                    f"one in a folder to write to, since its last records are in {log.name}"
                )
                raise FileError("store", str(self.path), allowed) from None
            return connect("immutable=1")

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
            kind = StoreError if _was_ours(self.path) else FileError
            raise kind("store", str(self.path), "the file of a campaign")
        elif version != self.schema.version:
            self._migrate(version, writable)
        self._database.execute(
            "CREATE TEMP TABLE damaged (id INTEGER PRIMARY KEY, cell, start)"
        )
        if writable:
            # The file must survive a crash of the machine as it survives one of the process.
            self._database.execute("PRAGMA journal_mode = WAL")
            self._database.execute("PRAGMA synchronous = FULL")

    def _migrate(self, version: int, writable: bool) -> None:
        """Bring the store to the schema's version, or a temporary copy if it is only read."""
        known = self.schema.version
        steps = [self.schema.migrations.get(v) for v in range(version, known)]
        if version > known:
            allowed = f"version {known} or older; a newer lockedjoint made it"
            raise StoreError("version of the store", version, allowed)
        if None in steps:
            allowed = f"version {known}; this one is too old to be brought up to it"
            raise FileError("version of the store", version, allowed)
        self._check_pages()
        if not writable:
            copy = sqlite3.connect("", isolation_level=None)  # a file that SQLite deletes
            copy.text_factory = _text
            with closing(self._database) as original:
                self._database = copy
                original.backup(copy)
        with self._transaction():
            for statement in (statement for step in steps for statement in step or ()):
                self._database.execute(statement)
            columns = self._database.execute("PRAGMA main.table_info(record)").fetchall()
            if "checksum" not in (name for _, name, *_ in columns):
                self._add_checksums()
            self._database.execute(f"PRAGMA user_version = {known}")

    def _add_checksums(self) -> None:
        """Add checksums to a store from before there were any."""
        self.checksums = False
        self._database.execute("ALTER TABLE record ADD COLUMN checksum BLOB")
        names = list(self.schema.values)
        select = f"SELECT rowid, cell, environment, start, {', '.join(names)} FROM record"
        update = "UPDATE record SET checksum = ? WHERE rowid = ?"
        for number, cell, environment, start, *values in self._database.execute(select):
            checksum = self._checksum(cell, environment)
            if checksum is not None:
                made = checksum(start, names, values)
                self._database.execute(update, (made, number))

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
                self._begun.clear()  # it may be of rows that are gone
                raise

    @contextmanager
    def _clear(self) -> Iterator[None]:
        """Turn SQLite's errors into one sentence."""
        try:
            yield
        except UnicodeDecodeError:  # SQLite quotes a damaged name
            raise StoreError("store", str(self.path), "one that is intact") from None
        except sqlite3.Error as reason:
            code = _code(reason)
            no_database = code == sqlite3.SQLITE_NOTADB and _was_ours(self.path)
            damaged = code in _DAMAGE or no_database
            kind = StoreError if damaged else FileError
            raise kind("store", str(self.path), _advice(reason)) from None


def _end(found: sqlite3.Cursor) -> None:
    with suppress(sqlite3.ProgrammingError):  # the store was closed before its reader ended
        found.close()


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is too long
        return False


def _text(raw: bytes) -> str:
    """Read text that may be damaged: its record has another checksum then."""
    return raw.decode(errors="surrogateescape")


def _was_ours(path: Path) -> bool:
    """Whether a file that cannot be read as a store has been one: it starts with the tables."""
    with suppress(OSError), path.open("rb") as file:
        return b"CREATE TABLE record (cell INTEGER" in file.read(_HEAD)
    return False


def _code(reason: sqlite3.Error) -> int:
    """Return SQLite's primary code of an error; 0 if it has none."""
    return int(getattr(reason, "sqlite_errorcode", 0)) & 0xFF


def _advice(reason: sqlite3.Error) -> str:
    if "full" in str(reason) or "disk I/O" in str(reason):
        return f"a file on a disk with room ({reason}); what it holds is kept, run again"
    if "locked" in str(reason):
        return f"a file that no other process writes to for long ({reason})"
    if _code(reason) in _DAMAGE:
        return f"one that is intact ({reason})"
    return f"the file of a campaign, in a folder to write to ({reason})"
