"""Which columns a store has, and conditions on them that cannot be anything else."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from nlp.errors import InputError

Kind = Literal["INTEGER", "REAL", "TEXT", "BLOB"]
Value: TypeAlias = str | int | float | bytes | None

OPERATORS = ("!=", "<=", ">=", "=", "<", ">")
_CONDITION = re.compile(
    r"\s*(?P<column>\w+)\s*(?P<operator>!=|<=|>=|=|<|>)\s*(?P<value>.*?)\s*"
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
        Columns that tell cells apart. None of them may be NULL.
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
    def columns(self) -> tuple[str, ...]:
        """Names of all columns, settings first."""
        return (*self.settings, "start", *self.values, "environment")

    def kind(self, column: str) -> Kind:
        """Return the kind of a column; InputError if there is none of that name."""
        found: dict[str, Kind] = {
            **self.settings,
            "start": "INTEGER",
            **self.values,
            "environment": "TEXT",
        }
        if column not in found:
            raise InputError("column", column, "one of " + ", ".join(self.columns))
        return found[column]

    def qualified(self, column: str) -> str:
        """Return a column's name with its table's."""
        self.kind(column)
        if column == "environment":
            return "environment.environment"
        return f"{'cell' if column in self.settings else 'record'}.{column}"


@dataclass(frozen=True)
class Condition:
    """A column compared with a value: ``column operator value``."""

    column: str
    operator: str
    value: Value

    def clause(self, schema: Schema) -> str:
        """Return the condition in SQL, a question mark for the value."""
        if self.operator not in OPERATORS:
            raise InputError("operator", self.operator, "one of " + " ".join(OPERATORS))
        return f"{schema.qualified(self.column)} {self.operator} ?"


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
    return Condition(column, parts["operator"], _value(column, kind, parts["value"]))


def _value(column: str, kind: Kind, text: str) -> Value:
    if kind == "BLOB":
        raise InputError("condition", column, "a column of numbers or text")
    if kind == "TEXT":
        return text
    truth = {"true": 1, "yes": 1, "false": 0, "no": 0}
    if kind == "INTEGER" and text.lower() in truth:
        return truth[text.lower()]
    try:
        number = int(text) if kind == "INTEGER" else float(text)
    except ValueError:
        number = math.nan
    if math.isnan(number) or (isinstance(number, int) and abs(number) >= 2**63):
        kinds = {"INTEGER": "a whole number", "REAL": "a number"}
        raise InputError(f"value of {column}", text, kinds[kind])
    return number


def create_statements(schema: Schema) -> list[str]:
    """Return the statements that make an empty store."""
    settings = ", ".join(f"{name} {kind} NOT NULL" for name, kind in schema.settings.items())
    values = ", ".join(f"{name} {kind}" for name, kind in schema.values.items())
    return [
        f"CREATE TABLE cell (id INTEGER PRIMARY KEY, {settings}, "
        f"UNIQUE ({', '.join(schema.settings)}))",
        "CREATE TABLE environment (id INTEGER PRIMARY KEY, environment TEXT NOT NULL UNIQUE)",
        "CREATE TABLE record (cell INTEGER NOT NULL REFERENCES cell, start INTEGER NOT NULL, "
        f"environment INTEGER NOT NULL REFERENCES environment, {values}, "
        "PRIMARY KEY (cell, start))",
        f"PRAGMA application_id = {schema.application}",
        f"PRAGMA user_version = {schema.version}",
    ]


def to_sql(value: Value) -> Value:
    """Return a value as the store keeps it: NaN as NULL."""
    return None if isinstance(value, float) and math.isnan(value) else value


def from_sql(kind: Kind, value: Value) -> Value:
    """Return a value as it was before `to_sql`."""
    return math.nan if value is None and kind == "REAL" else value
