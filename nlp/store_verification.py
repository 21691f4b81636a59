"""Which records of a store are intact: each is compared with its checksum.

A file is verified when it is opened, and records that arrive later before the next query reads
them. The damaged ones are listed in the table ``temp.damaged``, which only this process has.
"""

from collections.abc import Mapping
from itertools import groupby
from operator import itemgetter
from typing import Any

from nlp.errors import StoreError
from nlp.store_checks import Checksum, Damage, fits, sentence
from nlp.store_file import StoreFile
from nlp.store_schema import Kind, Schema


class Checksums:
    """What computes the checksums of the records of each cell and environment."""

    def __init__(self, file: StoreFile, schema: Schema) -> None:
        self._file, self._schema = file, schema
        self._begun: dict[tuple[int, int], Checksum] = {}

    def of(self, cell: int, environment: int) -> Checksum | None:
        """Return what computes the checksums of such records; None if there is no such row."""
        key = (cell, environment)
        if key not in self._begun:
            settings = self.settings(cell)
            select = "SELECT environment FROM environment WHERE id = ?"
            text = self._file.execute(select, (environment,)).fetchone()
            if settings is None or text is None:
                return None
            kinds: list[Kind] = [*self._schema.settings.values(), "TEXT"]
            if not all(map(fits, kinds, (*settings.values(), *text))):
                return None
            self._begun[key] = Checksum(list(settings.values()), text[0])
        return self._begun[key]

    def settings(self, cell: object) -> Mapping[str, Any] | None:
        """Return the settings of a cell; None if there is no such row."""
        names = list(self._schema.settings)
        select = f"SELECT {', '.join(names)} FROM cell WHERE id = ?"
        found = self._file.execute(select, (cell,)).fetchone()
        return None if found is None else dict(zip(names, found, strict=True))

    def forget(self) -> None:
        """Read cells and environments anew."""
        self._begun.clear()


class Verification:
    """The records that were verified so far.

    Parameters
    ----------
    file
        The store's.
    schema
        Its columns.
    checksums
        Of its records.
    salvage
        Whether damaged records are no error.

    Attributes
    ----------
    last
        Row of the last record that was verified.
    """

    def __init__(
        self, file: StoreFile, schema: Schema, checksums: Checksums, *, salvage: bool
    ) -> None:
        self.last = 0
        self._file, self._schema = file, schema
        self._checksums, self._salvage = checksums, salvage
        file.execute("CREATE TEMP TABLE damaged (id INTEGER PRIMARY KEY, cell, start)")

    def update(self) -> None:
        """Verify the records that came since the last time.

        Raises
        ------
        StoreError
            If some are damaged, and the others are not to be salvaged.
        """
        names = list(self._schema.values)
        select = (
            f"SELECT rowid, cell, environment, start, checksum, {', '.join(names)} "
            "FROM main.record WHERE rowid > ? ORDER BY rowid"
        )
        kinds: list[Kind] = ["INTEGER", *self._schema.values.values()]
        damaged = []
        with self._file.errors():
            for row in self._file.execute(select, (self.last,)):
                self.last, cell, environment, start, kept, *values = row
                checksum = self._checksums.of(cell, environment)
                same = checksum is not None and checksum(start, names, values) == kept
                if not (same and all(map(fits, kinds, (start, *values)))):
                    damaged.append((self.last, cell, start))
            if damaged:
                insert = "INSERT INTO temp.damaged (id, cell, start) VALUES (?, ?, ?)"
                self._file.execute_many(insert, damaged)
                if not self._salvage:
                    allowed = f"one whose records are intact; it has {sentence(self.damaged)}"
                    raise StoreError("store", str(self._file.path), allowed)

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """The damaged records by cell, as far as the store has been verified."""
        select = "SELECT cell, start FROM temp.damaged ORDER BY cell, start"
        with self._file.errors():
            found = self._file.execute(select).fetchall()
            return tuple(
                Damage(cell, self._checksums.settings(cell), tuple(start for _, start in some))
                for cell, some in groupby(found, key=itemgetter(0))
            )

    def is_damaged(self, cell: int, start: int) -> bool:
        """Whether a record is among the damaged ones."""
        select = "SELECT count(*) FROM temp.damaged WHERE cell = ? AND start = ?"
        return self._file.value(select, (cell, start)) > 0
