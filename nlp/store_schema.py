"""The columns of a store, the SQL statements that follow from them, and conditions on them."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from nlp.errors import InputError
from nlp.files import real_in, whole_in

Kind = Literal["INTEGER", "REAL", "TEXT", "BLOB"]
Value: TypeAlias = str | int | float | bytes | None

OPERATORS = ("!=", "<=", ">=", "=", "<", ">")
_CONDITION = re.compile(
    rf"\s*(?P<column>\w+)\s*(?P<operator>{'|'.join(OPERATORS)})\s*(?P<value>.*?)\s*"
)


@dataclass(frozen=True)
class Schema:
    """The columns of a store.

    Attributes
    ----------
    application
        Number that marks the file as one of these stores, 32 bits.
    version
        Version of the columns, from 1.
    settings
        Columns that identify a cell. None of them may be NULL.
    values
        Columns of a record besides its ``start`` and ``environment``.
    migrations
        Statements that take a store from the version they are listed under to the next.
    """

    application: int
    version: int
    settings: Mapping[str, Kind]
    values: Mapping[str, Kind]
    migrations: Mapping[int, Sequence[str]] = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, Kind]:
        """All columns of a record with its cell, and their kinds; settings first."""
        start: dict[str, Kind] = {"start": "INTEGER"}
        return {**self.settings, **start, **self.values, "environment": "TEXT"}

    def kind(self, column: str) -> Kind:
        """Return the kind of a column; InputError if there is none of that name."""
        if column not in self.columns:
            raise InputError("column", column, "one of " + ", ".join(self.columns))
        return self.columns[column]

    def creation(self) -> list[str]:
        """Return the statements that make an empty store."""
        settings = ", ".join(f"{name} {kind} NOT NULL" for name, kind in self.settings.items())
        values = ", ".join(f"{name} {kind}" for name, kind in self.values.items())
        return [
            f"CREATE TABLE cell (id INTEGER PRIMARY KEY, {settings}, "
            f"UNIQUE ({', '.join(self.settings)}))",
            "CREATE TABLE environment "
            "(id INTEGER PRIMARY KEY, environment TEXT NOT NULL UNIQUE)",
            "CREATE TABLE record (cell INTEGER NOT NULL REFERENCES cell, "
            "start INTEGER NOT NULL, environment INTEGER NOT NULL REFERENCES environment, "
            f"{values}, checksum BLOB, PRIMARY KEY (cell, start))",
            f"PRAGMA application_id = {self.application}",
            f"PRAGMA user_version = {self.version}",
        ]

    def tables(self) -> dict[str, dict[str, str]]:
        """Return the columns of each table, and their types."""
        return {
            "cell": {"id": "INTEGER", **self.settings},
            "environment": {"id": "INTEGER", "environment": "TEXT"},
            "record": {
                **dict.fromkeys(("cell", "start", "environment"), "INTEGER"),
                **self.values,
                "checksum": "BLOB",
            },
        }

    def records(self, last: int) -> str:
        """Return the SELECT of the intact records, with number and settings of their ``cell``.

        Records after row `last` are not verified yet and left out.
        """
        listed = ", ".join([*self.settings, "start", *self.values])
        return (
            f"SELECT record.cell AS cell, {listed}, environment.environment AS environment "
            "FROM main.record AS record JOIN main.cell AS cell ON cell.id = record.cell "
            "JOIN main.environment AS environment ON environment.id = record.environment "
            f"WHERE record.rowid <= {last} "
            "AND record.rowid NOT IN (SELECT id FROM temp.damaged)"
        )


@dataclass(frozen=True)
class Condition:
    """A column compared with a value: ``column operator value``."""

    column: str
    operator: str
    value: Value

    def clause(self, schema: Schema) -> str:
        """Return the condition in SQL, a question mark for the value."""
        schema.kind(self.column)
        if self.operator not in OPERATORS:
            raise InputError("operator", self.operator, "one of " + " ".join(OPERATORS))
        return f"{self.column} {self.operator} ?"


def condition(schema: Schema, text: str) -> Condition:
    """Read a condition such as ``joints=7`` or ``iterations >= 100``.

    Raises
    ------
    InputError
        If it is no comparison, there is no such column, or the value is not of its kind.
    """
    parts = _CONDITION.fullmatch(text)
    if parts is None:
        allowed = "COLUMN=VALUE, or with one of " + " ".join(OPERATORS)
        raise InputError("condition", text, allowed)
    column, kind = parts["column"], schema.kind(parts["column"])
    if kind == "BLOB":
        raise InputError("condition", column, "a column of numbers or text")
    value = parts["value"] if kind == "TEXT" else _number(column, kind, parts["value"])
    return Condition(column, parts["operator"], value)


def _number(column: str, kind: Kind, text: str) -> int | float:
    truth = {"true": 1, "yes": 1, "false": 0, "no": 0}
    if kind == "INTEGER" and text.lower() in truth:
        return truth[text.lower()]
    try:
        number = whole_in(text) if kind == "INTEGER" else real_in(text)
    except ValueError:
        number = math.nan
    if math.isnan(number) or (isinstance(number, int) and abs(number) >= 2**63):
        allowed = "a whole number" if kind == "INTEGER" else "a number"
        raise InputError(f"value of {column}", text, allowed)
    return number
