"""Conditions on the records of a study, such as ``joints=7`` or ``iterations >= 100``."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from formulations.campaign.records import COLUMNS
from nlp.errors import InputError
from nlp.files import real_in

if TYPE_CHECKING:
    import pandas as pd

_OPERATORS: Mapping[str, Callable[[Any, Any], Any]] = {
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "=": operator.eq,
    "<": operator.lt,
    ">": operator.gt,
}
_CONDITION = re.compile(
    rf"\s*(?P<column>\w+)\s*(?P<sign>{'|'.join(_OPERATORS)})\s*(?P<value>.*?)\s*"
)
_TRUTH = {"true": True, "yes": True, "false": False, "no": False}


@dataclass(frozen=True)
class Condition:
    """A column compared with a value, a number or a text."""

    column: str
    sign: str
    value: str

    def holds(self, table: pd.DataFrame) -> pd.Series[bool]:
        """Return for each row of a table whether it meets the condition.

        Raises
        ------
        InputError
            If there is no such column, or the value is not of its kind.
        """
        if self.column not in table:
            raise InputError("column", self.column, "one of " + ", ".join(map(str, table)))
        given: object = self.value
        column = table[self.column]
        if column.map(lambda entry: isinstance(entry, str)).all():
            return _OPERATORS[self.sign](column, given)  # type: ignore[no-any-return]
        if self.value.lower() in _TRUTH:
            given = _TRUTH[self.value.lower()]
        else:
            try:
                given = real_in(self.value)
            except ValueError:
                given = float("nan")
            if not math.isfinite(given):
                raise InputError(f"value of {self.column}", self.value, "a number")
        return _OPERATORS[self.sign](column, given)  # type: ignore[no-any-return]


def condition(text: str) -> Condition:
    """Read a condition such as ``joints=7`` or ``iterations >= 100``.

    Raises
    ------
    InputError
        If it is no comparison, or of a column of matrices.
    """
    parts = _CONDITION.fullmatch(text)
    if parts is None:
        allowed = "COLUMN=VALUE, or with one of " + " ".join(_OPERATORS)
        raise InputError("condition", text, allowed)
    if COLUMNS.get(parts["column"]) == "BLOB":
        raise InputError("condition", parts["column"], "a column of numbers or text")
    return Condition(parts["column"], parts["sign"], parts["value"])
