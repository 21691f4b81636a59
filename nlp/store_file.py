"""The SQLite file of a store: how it is opened, read, written and closed.

It is in write-ahead mode: one process writes, others read meanwhile. SQLite's errors become one
sentence.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

from nlp.errors import FileError, StoreError
from nlp.store_lock import WriterLock

_BUSY_SECONDS = 60.0
_HEAD = 1 << 16  # bytes of the largest page, the first of which lists the tables
# SQLite's codes for a file that has not the tables that it should have.
_DAMAGE = (sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT)
# Its codes where it cannot make the files of its log, in a folder that is not writable.
_NO_LOG = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY)


class StoreFile:
    """An open file; what is in it is not looked at.

    Parameters
    ----------
    path
        The file. Its folder must exist.
    writable
        Whether to write to it. It is made if there is none, and no other process may write to
        it until it is closed.

    Raises
    ------
    FileError
        If it cannot be opened, or is no database.
    StoreError
        If it is damaged, or another process writes to it.
    """

    def __init__(self, path: Path, *, writable: bool) -> None:
        self.path = path
        self.writable = writable
        if not writable and not _is_file(path):
            raise FileError("store", str(path), "the file of a campaign")
        with ExitStack() as opened, self.errors():
            if writable:
                opened.callback(WriterLock(path).release)
            else:
                opened.callback(self._remove_empty_log)
            self._database = self._connected()
            opened.callback(lambda: self._database.close())
            if writable:
                opened.callback(self._empty_log)
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close the file; what was added is on the disk already."""
        with self.errors():
            self._opened.close()

    def execute(self, statement: str, values: Sequence[object] = ()) -> sqlite3.Cursor:
        """Execute a statement, with values for its question marks."""
        return self._database.execute(statement, values)

    def execute_many(self, statement: str, lines: Iterable[Sequence[object]]) -> None:
        """Execute a statement once for each line of values."""
        self._database.executemany(statement, lines)

    def value(self, select: str, values: Sequence[object] = ()) -> int:
        """Return the whole number that a SELECT or a PRAGMA gives."""
        return int(self.execute(select, values).fetchone()[0])

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all that is executed in the block, or nothing of it."""
        with self.errors():
            self.execute("BEGIN IMMEDIATE")
            try:
                yield
                self.execute("COMMIT")
            except BaseException:
                if self._database.in_transaction:  # SQLite may have rolled back by itself
                    self.execute("ROLLBACK")
                raise

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Turn SQLite's errors into one sentence."""
        try:
            yield
        except UnicodeDecodeError:  # SQLite quotes a damaged name
            raise StoreError("store", str(self.path), "one that is intact") from None
        except sqlite3.Error as reason:
            code = _code(reason)
            no_database = code == sqlite3.SQLITE_NOTADB and self.was_ours
            damaged = code in _DAMAGE or no_database
            kind = StoreError if damaged else FileError
            raise kind("store", str(self.path), _advice(reason)) from None

    @property
    def was_ours(self) -> bool:
        """Whether a file that cannot be read has been a store: it starts with the tables."""
        with suppress(OSError), self.path.open("rb") as file:
            return b"CREATE TABLE record (cell INTEGER" in file.read(_HEAD)
        return False

    def check_pages(self) -> None:
        """Refuse a file whose structure is damaged: which records it has is not known then."""
        found = self.execute("PRAGMA main.integrity_check(1)").fetchone()[0]
        if found != "ok":
            raise StoreError("store", str(self.path), f"one that is intact ({found})")

    def survive_crashes(self) -> None:
        """Have the file survive a crash of the machine as it survives one of the process."""
        self.execute("PRAGMA journal_mode = WAL")
        self.execute("PRAGMA synchronous = FULL")

    def continue_in_copy(self) -> None:
        """Go on with a temporary copy; the file stays as it is."""
        copy = sqlite3.connect("", isolation_level=None)  # a file that SQLite deletes
        copy.text_factory = _text
        with closing(self._database) as original:
            self._database = copy
            original.backup(copy)

    def _connected(self) -> sqlite3.Connection:
        try:
            return self._connection(f"mode={'rwc' if self.writable else 'ro'}")
        except sqlite3.OperationalError as reason:
            if self.writable or _code(reason) not in _NO_LOG:
                raise
            log = self._beside("-wal")
            if log.exists() and log.stat().st_size:
                allowed = (
                    f"one in a folder to write to, since its last records are in {log.name}"
                )
                raise FileError("store", str(self.path), allowed) from None
            return self._connection("immutable=1")

    def _connection(self, how: str) -> sqlite3.Connection:
        opened = sqlite3.connect(
            f"{self.path.absolute().as_uri()}?{how}",
            uri=True,
            timeout=_BUSY_SECONDS,
            isolation_level=None,  # transactions are those of `transaction` only
        )
        opened.text_factory = _text
        opened.execute("PRAGMA trusted_schema = OFF")  # it may come from anybody
        try:
            opened.execute("PRAGMA schema_version").fetchone()  # reads the file
        except BaseException:
            opened.close()
            raise
        return opened

    def _empty_log(self) -> None:
        """Bring what is in the log into the file, so that the file is all there is."""
        with suppress(sqlite3.OperationalError):  # others read the log
            self.execute("PRAGMA busy_timeout = 100")
            self.execute("PRAGMA wal_checkpoint(TRUNCATE)")

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

    def _beside(self, ending: str) -> Path:
        """Return a file of SQLite's; it is beside what a link leads to."""
        whole = self.path.resolve()
        return whole.with_name(whole.name + ending)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is too long
        return False


def _text(raw: bytes) -> str:
    """Read text that may be damaged: its record has another checksum then."""
    return raw.decode(errors="surrogateescape")


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
