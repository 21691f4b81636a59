"""Checksums of a store's records, and damaged records in words.

The checksum of a record covers all that a reader gets: the settings of its cell, its start,
its values and the text of its environment. Values that are NULL are left out, so a column that
a later version adds changes no checksum.
"""

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nlp.store_schema import Kind, Value

# Longer settings, such as all options of a solver, are left out of a sentence.
_LONGEST = 40
# As many runs of starts, and as many cells, are in a sentence.
_MOST = 8
_TYPES: Mapping[Kind, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}


def plain(kind: Kind, value: Any) -> Value:
    """Return a value as it comes back from a column of this kind; NaN as None."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    return _TYPES[kind](value)  # type: ignore[no-any-return]


def fits(kind: Kind, value: object) -> bool:
    """Whether a value of the file is of its column's kind, or NULL; text must be in UTF-8."""
    if isinstance(value, str):
        return kind == "TEXT" and (value.isascii() or _encodable(value))
    return value is None or type(value) is _TYPES[kind]


def _encodable(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


class Checksum:
    """Checksums of the records of one cell that were made in one environment."""

    def __init__(self, settings: Sequence[object], environment: str) -> None:
        # `ascii` of these types is the same in every version of Python, and exact.
        self._begun = hashlib.blake2b(ascii((*settings, environment)).encode(), digest_size=16)

    def __call__(self, start: object, names: Sequence[str], values: Iterable[object]) -> bytes:
        """Return the checksum of a start's values, which `plain` has been applied to."""
        pairs = [pair for pair in zip(names, values, strict=True) if pair[1] is not None]
        whole = self._begun.copy()
        whole.update(ascii((start, pairs)).encode())
        return whole.digest()


@dataclass(frozen=True)
class Damage:
    """Damaged records of one cell.

    Attributes
    ----------
    cell
        Number of the cell.
    settings
        What the file has as its settings, which may be what is damaged; None if it has none.
    starts
        The starts, in order.
    """

    cell: object
    settings: Mapping[str, object] | None
    starts: tuple[object, ...]

    def __str__(self) -> str:
        """Return starts, number and short settings of the cell."""
        runs = _runs(self.starts)
        listed = ", ".join(runs[:_MOST]) + (" and more" if len(runs) > _MOST else "")
        given = (f"{name}={value}" for name, value in (self.settings or {}).items())
        known = ", ".join(one for one in given if len(one) <= _LONGEST) or "settings are lost"
        several = "s" if len(self.starts) > 1 else ""
        return f"start{several} {listed} of cell {self.cell} ({known})"


def sentence(damaged: Sequence[Damage]) -> str:
    """Return how many records are damaged, and which."""
    total = sum(len(one.starts) for one in damaged)
    listed = "; ".join(map(str, damaged[:_MOST]))
    more = f"; and of {len(damaged) - _MOST} more cells" if len(damaged) > _MOST else ""
    return f"{total} damaged record{'s' if total > 1 else ''}: {listed}{more}"


def _runs(starts: Sequence[object]) -> list[str]:
    """Return runs of consecutive starts, such as 0-19; what is no number stands alone."""
    runs: list[list[object]] = []
    for start in starts:
        last = runs[-1][-1] if runs else None
        if isinstance(start, int) and isinstance(last, int) and start == last + 1:
            runs[-1].append(start)
        else:
            runs.append([start])
    return [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
