"""The lock of the one process that writes a store."""

import os
import sqlite3
import time
from contextlib import suppress
from pathlib import Path

from nlp.errors import StoreError


class WriterLock:
    """Held while a store is written; the operating system frees it when the process ends.

    The lock is SQLite's own, on a file beside the store, so it works on every system. The file
    holds the number of the process. It is deleted by `release`; if a killed process leaves it
    behind, it locks nothing.

    Raises
    ------
    StoreError
        If another process writes to the store.
    sqlite3.Error
        If the file cannot be made.
    """

    def __init__(self, store: Path) -> None:
        whole = store.resolve()
        self._path = whole.with_name(f"{whole.name}-writer")
        self._database = sqlite3.connect(self._path, timeout=0, isolation_level=None)
        try:
            self._take(store)
        except BaseException:
            self._database.close()
            raise

    def _take(self, store: Path) -> None:
        try:
            # Twice: the number has to be committed for others to read it.
            self._database.execute("PRAGMA journal_mode = MEMORY")
            self._database.execute("BEGIN IMMEDIATE")
            self._database.execute(f"PRAGMA user_version = {os.getpid()}")
            self._database.execute("COMMIT")
            self._database.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as reason:
            if reason.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY:
                raise
            number = self._holder()
            process = f"process {number}" if number else "another process"
            allowed = f"one that no other process writes; it is being written by {process}"
            raise StoreError("store", str(store), allowed) from None

    def _holder(self) -> int:
        """Return the number of the process that has the lock; 0 if it does not give it."""
        number = 0
        for _ in range(20):  # it may just be writing the number
            with suppress(sqlite3.OperationalError):
                number = int(self._database.execute("PRAGMA user_version").fetchone()[0])
            if number:
                break
            time.sleep(0.05)
        return number

    def release(self) -> None:
        """Let others write."""
        with suppress(OSError):  # some systems do not delete open files
            self._path.unlink()
        self._database.close()
