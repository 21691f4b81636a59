"""Read a certificate file strictly: what is not exactly in the format is refused.

Every refusal is one sentence that says where and what. Sizes are bounded before anything is
built, so that no file keeps the reader busy for long.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

from formulations.existence.certificate import (
    Certificate,
    CertificateError,
    Multiplier,
    Pairs,
    Square,
    Term,
)
from nlp.errors import FileError

FILE_BYTES = 2_000_000
DIGITS = 40
RATIONAL = re.compile(rf"-?(0|[1-9][0-9]{{0,{DIGITS - 1}}})(/[1-9][0-9]{{0,{DIGITS - 1}}})?")

Record = TypeVar("Record")


def read(path: Path | str) -> Certificate:
    """Return the certificate in a file.

    Raises
    ------
    FileError
        If the file cannot be read, is too large, or is not a JSON text in UTF-8.
    CertificateError
        If the JSON text is not a well-formed certificate.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(str(path), f"not readable ({reason})", "a readable file") from error
    if len(content) > FILE_BYTES:
        raise FileError(str(path), "too large", f"a file of at most {FILE_BYTES} bytes")
    try:
        text = content.decode("utf-8")
        value = json.loads(text, object_pairs_hook=_distinct_keys, parse_int=_short_integer)
    except UnicodeDecodeError as error:
        raise FileError(str(path), "not in UTF-8", "a JSON text in UTF-8") from error
    except json.JSONDecodeError as error:
        raise FileError(str(path), f"not JSON ({error})", "a complete JSON text") from error
    except RecursionError as error:
        raise FileError(str(path), "nested too deeply", "a certificate in JSON") from error
    return _certificate(value)


def _certificate(value: Any) -> Certificate:
    fields = _fields(value, "joints", "constant", "squares", "multipliers")
    return Certificate(
        joints=_at("joints", _joint, fields["joints"]),
        constant=_at("constant", _rational, fields["constant"]),
        squares=_at("squares", _list_of(_square), fields["squares"]),
        multipliers=_at("multipliers", _list_of(_multiplier), fields["multipliers"]),
    )


def _square(value: Any) -> Square:
    fields = _fields(value, "weight", "terms")
    return Square(
        weight=_at("weight", _rational, fields["weight"]),
        terms=_at("terms", _list_of(_term), fields["terms"]),
    )


def _term(value: Any) -> Term:
    fields = _fields(value, "coefficient", "w", "wbar")
    return Term(
        coefficient=_at("coefficient", _rational, fields["coefficient"]),
        w=_at("w", _pairs, fields["w"]),
        wbar=_at("wbar", _pairs, fields["wbar"]),
    )


def _multiplier(value: Any) -> Multiplier:
    fields = _fields(value, "coefficient", "equation", "w", "wbar")
    kind, place = _at("equation", _equation, fields["equation"])
    return Multiplier(
        coefficient=_at("coefficient", _rational, fields["coefficient"]),
        kind=kind,
        place=place,
        w=_at("w", _pairs, fields["w"]),
        wbar=_at("wbar", _pairs, fields["wbar"]),
    )


def _equation(value: Any) -> tuple[Any, tuple[int, ...]]:
    """Return kind and place; the record decides whether there is such an equation."""
    if isinstance(value, dict) and value.get("kind") == "row-sum":
        return "row-sum", (_at("row", _joint, _fields(value, "kind", "row")["row"]),)
    fields = _fields(value, "kind", "entry")
    if not isinstance(fields["kind"], str):
        raise CertificateError(f"kind is {_shown(fields['kind'])}, not a string.")
    return fields["kind"], _at("entry", _list_of(_joint), fields["entry"])


def _pairs(value: Any) -> Pairs:
    return _list_of(_pair)(value)


def _pair(value: Any) -> tuple[int, int]:
    joints = _list_of(_joint)(value)
    if len(joints) != 2:
        raise CertificateError(f"a list of {len(joints)} joints is not a pair.")
    return joints[0], joints[1]


def _joint(value: Any) -> int:
    if type(value) is not int:  # True is an int too
        raise CertificateError(f"{_shown(value)} is not a whole number.")
    return value


def _rational(value: Any) -> Fraction:
    if not isinstance(value, str) or RATIONAL.fullmatch(value) is None:
        raise CertificateError(
            f'{_shown(value)} is not a rational number in a string such as "-3/2", '
            f"with at most {DIGITS} digits above and below."
        )
    return Fraction(value)


def _fields(value: Any, *names: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise CertificateError(f"{_shown(value)} is not an object with {', '.join(names)}.")
    for name in names:
        if name not in value:
            raise CertificateError(f"{name!r} is missing.")
    for name in value:
        if name not in names:
            raise CertificateError(f"the key {_shown(name)} is unknown.")
    return value


def _list_of(read_one: Callable[[Any], Record]) -> Callable[[Any], tuple[Record, ...]]:
    def read_all(value: Any) -> tuple[Record, ...]:
        if not isinstance(value, list):
            raise CertificateError(f"{_shown(value)} is not a list.")
        return tuple(_at(f"[{place}]", read_one, item) for place, item in enumerate(value))

    return read_all


def _at(place: str, read_one: Callable[[Any], Record], value: Any) -> Record:
    """Read a part; if it is refused, say where."""
    try:
        return read_one(value)
    except CertificateError as error:
        raise CertificateError(f"{place}: {error}") from None


def _distinct_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise CertificateError("a key is given twice in one object.")
    return found


def _short_integer(digits: str) -> int:
    if len(digits) > DIGITS:
        raise CertificateError(f"an integer of {len(digits)} digits is not a joint.")
    return int(digits)


def _shown(value: Any) -> str:
    if isinstance(value, (list, dict)):
        return "a list" if isinstance(value, list) else "an object"
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:59] + "…"
