"""Names of strangers in texts that other programs read: C, Markdown and HTML, CSV, YAML.

A robot's file, a store or a certificate may name a joint, a link or a model as it likes. Each
function makes a text of which the reader takes no part for its own syntax. LaTeX's special
characters are escaped by tabulate, JSON by `json`, URDF by `xml`; SVG by matplotlib, see
`figures.style.literal`.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from lockedjoint.nlp.errors import printable

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
# Greek letters, and their names in LaTeX. pdfLaTeX stops at these letters and at the symbols
# below.
_GREEK = "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"
_GREEK_NAMES = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "upsilon varphi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega"
)
_MATHEMATICS = {
    "√": r"\surd",
    "−": "-",
    "‖": r"\Vert",
    "≤": r"\le",
    "≥": r"\ge",
    "≠": r"\ne",
    "≈": r"\approx",
    "ℓ": r"\ell",
    "∂": r"\partial",
    "∞": r"\infty",
    "→": r"\to",
    "⊥": r"\perp",
    "ᵀ": "^{T}",
    "⁺": "^{+}",
    "⁻": "^{-}",
}
# An asterisk or a bracket that begins a row: the end of a row, and a rule, take arguments.
_ROW_ARGUMENT = re.compile(r"((?:\\\\|\\toprule|\\midrule)\s*)([\[*])")
_IN_LATEX = str.maketrans(
    {
        letter: rf"\ensuremath{{\{name}}}"
        for letter, name in zip(_GREEK, _GREEK_NAMES.split(), strict=True)
    }
    | {one: rf"\ensuremath{{{text}}}" for one, text in _MATHEMATICS.items()}
)


def latex(table: str) -> str:
    """Return a table in LaTeX whose letters and symbols every LaTeX knows, pdfLaTeX too.

    What begins a row is not taken for an argument of the rule or row before.
    """
    return _ROW_ARGUMENT.sub(r"\1{\2}", table.translate(_IN_LATEX))


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


def rows_csv(rows: Sequence[Mapping[str, object]], names: Sequence[str] | None = None) -> str:
    """Return rows as CSV, see `csv_cell`; None and NaN as an empty cell.

    The columns are those of the names, by default of the first row; a row may lack some. A
    column of numbers with a float in it holds floats.
    """
    names = list(rows[0] if names is None and rows else names or ())
    columns = [_csv_column([row.get(name) for row in rows]) for name in names]
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(map(csv_cell, names))
    writer.writerows(zip(*columns, strict=True))
    return written.getvalue()


def _csv_column(values: Sequence[Any]) -> list[object]:
    known = [value for value in values if value is not None]
    are_numbers = all(isinstance(one, Real) and not isinstance(one, bool) for one in known)
    if are_numbers and any(isinstance(one, float) for one in known):
        values = [None if value is None else float(value) for value in values]
    return [None if value != value else csv_cell(value) for value in values]


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
