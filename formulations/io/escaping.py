"""Names of strangers in texts that other programs read: C, Markdown and HTML, CSV, YAML.

A robot's file, a store or a certificate may name a joint, a link or a model as it likes. Each
function makes a text of which the reader takes no part for its own syntax. LaTeX is escaped by
tabulate, JSON by `json`, URDF by `xml`; SVG by matplotlib, see `figures.style.literal`.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from lockedjoint.nlp.errors import printable

if TYPE_CHECKING:
    import pandas as pd

# Spreadsheets take these for the beginning of a formula, full-width forms included.
_FORMULA = tuple("=+-@\t\n＝＋－＠")
# A formula needs one of these to call a function or another program, or to read a sheet.
_ACTS = re.compile(r"[(|!=@：＝＠（｜！]")
# Characters that have a meaning in a cell in CommonMark, in GitHub's tables and mathematics, or
# in HTML.
_ACTIVE = re.compile(
    r"[|`\\$~]|<(?=[A-Za-z/!?])|&(?=[#A-Za-z])|](?=[(:\[])|(?<![^\W_])_|_(?![^\W_])|\*(?=\S)|(?<=\S)\*"
)
_HTML = {"<": "&lt;", "&": "&amp;"}
# A string of JSON, or a whole number with an exponent.
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|(?<![\d.])-?\d+(?=e[+-]?\d)')
# An escaped backslash in a string of JSON, or a character that is written as two surrogates.
_PAIR = re.compile(r"\\\\|\\u(d[89ab][0-9a-f]{2})\\u(d[c-f][0-9a-f]{2})")


def c_string(text: str) -> str:
    r"""Return a string literal of C with the text in UTF-8.

    ASCII letters, digits, blanks and ``_.-`` stand for themselves, all other bytes are octal:
    no byte ends the literal, begins a trigraph or splices lines.
    """
    plain = b"_.- "
    parts = [
        chr(byte) if (byte < 128 and chr(byte).isalnum()) or byte in plain else f"\\{byte:03o}"
        for byte in text.encode(errors="backslashreplace")
    ]
    return f'"{"".join(parts)}"'


def markdown(text: str) -> str:
    """Return a text as Markdown and HTML show it: what is no letter or digit as a reference.

    Character references are text wherever they stand, never syntax, in CommonMark as in HTML.
    """
    return "".join(
        one if one.isalnum() or one == " " else f"&#{ord(one)};" for one in printable(text)
    )


def markdown_cell(text: str) -> str:
    """Return a cell of a Markdown table, escaped only where it would be syntax.

    Such tables are read on terminals, too. HTML is escaped by references.
    """
    return _ACTIVE.sub(lambda one: _HTML.get(one[0], f"\\{one[0]}"), printable(text))


def csv_cell(value: object) -> object:
    """Return the value of a cell: a text that a spreadsheet could run begins with ``'``.

    The first character counts that is no blank. Numbers stay, and lists with commas. Control
    characters but line ends and tabs are escaped: not all of them would be quoted.
    """
    if not isinstance(value, str):
        return value
    value = printable(value, "\n\t")
    if not value.lstrip(" ").startswith(_FORMULA):
        return value
    # A text with a sign and a comma is no formula, unless something in it is called.
    if value.lstrip(" ").startswith(("+", "-")) and ", " in value and not _ACTS.search(value):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def frame_csv(frame: pd.DataFrame) -> str:
    """Return a DataFrame without its index as CSV, see `csv_cell`; NaN as an empty cell."""
    safe = frame.copy()
    for k, kind in enumerate(safe.dtypes):
        if str(kind) in ("object", "str", "string"):
            safe.isetitem(k, list(map(csv_cell, safe.iloc[:, k])))
    safe.columns = [csv_cell(name) for name in safe.columns]
    return str(safe.to_csv(index=False, lineterminator="\n"))


def yaml_text(values: object) -> str:
    r"""Return values as JSON that is YAML 1.1 as well.

    There a character beyond ``\uffff`` is one escape, and a number with an exponent has a
    point: ``1e-07`` would be a text.
    """
    return _TOKEN.sub(_in_yaml, json.dumps(values, indent=1, allow_nan=False)) + "\n"


def _in_yaml(token: re.Match[str]) -> str:
    """Return a token of JSON, a string or a number with an exponent, as YAML has it."""
    return _PAIR.sub(_one_escape, token[0]) if token[0][0] == '"' else f"{token[0]}.0"


def _one_escape(pair: re.Match[str]) -> str:
    """Return one escape for the two surrogates of a character; an escaped backslash stays."""
    if pair[1] is None:
        return pair[0]
    high, low = (int(half, 16) for half in pair.groups())
    return f"\\U{0x10000 + ((high - 0xD800) << 10) + (low - 0xDC00):08x}"
