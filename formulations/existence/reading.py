"""Read a certificate file strictly: what is not exactly in the format is refused.

Every error message is one sentence with the place and the fault. Sizes are limited before
anything is built, so that no file takes long to read. The reader checks the structure of the
JSON text; the records check the rest.
"""

import json
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from formulations.existence.certificate import (
    Certificate,
    CertificateError,
    Multiplier,
    Square,
    Term,
    shown,
)
from formulations.existence.exact_jacobian import ExactJacobian
from formulations.io.files import read_bytes
from nlp.errors import FileError

FILE_BYTES = 2_000_000
_MOST_VALUES = 500_000
DIGITS = 40
_RATIONAL = re.compile(rf"-?(0|[1-9][0-9]{{0,{DIGITS - 1}}})(/[1-9][0-9]{{0,{DIGITS - 1}}})?")

Record = TypeVar("Record")
Reader: TypeAlias = Callable[[Any], Record]


def read(path: Path | str) -> Certificate:
    """Return the certificate of nonexistence in a file.

    Raises
    ------
    FileError
        If the file cannot be read, is too large, or is not a JSON text in UTF-8.
    CertificateError
        If the JSON text is not a well-formed certificate.
    """
    return _certificate(loaded(path))


def read_either(path: Path | str) -> Certificate | ExactJacobian:
    """Return the certificate in a file, of nonexistence or, if it has columns, of existence.

    Raises
    ------
    FileError, CertificateError
        As `read` does.
    """
    value = loaded(path)
    if isinstance(value, dict) and "columns" in value:
        return _exact_jacobian(value)
    return _certificate(value)


def loaded(path: Path | str, most: int = FILE_BYTES) -> Any:
    """Return what the JSON text in a file of at most `most` bytes says.

    Raises
    ------
    FileError, CertificateError
        As `read` does.
    """
    content = read_bytes(Path(path), most=most)
    if sum(map(content.count, (b",", b"[", b"{"))) > _MOST_VALUES:
        raise FileError("file", str(path), f"a file of at most {_MOST_VALUES} values")
    try:
        text = content.decode("utf-8")
        return json.loads(text, object_pairs_hook=_distinct_keys, parse_int=_short_integer)
    except UnicodeDecodeError:
        why = "it is not in UTF-8"
    except json.JSONDecodeError as error:
        why = f"not JSON: {error}"
    except RecursionError:
        why = "nested too deeply"
    raise FileError("file", str(path), f"a certificate in JSON ({why})")


def _rational(value: Any) -> Fraction:
    if not isinstance(value, str) or _RATIONAL.fullmatch(value) is None:
        raise CertificateError(
            f'{shown(value)} is not a rational number in a string such as "-3/2", '
            f"with at most {DIGITS} digits above and below."
        )
    return Fraction(value)


def fields_of(value: Any, *names: str) -> dict[str, Any]:
    """Return an object with exactly these keys; CertificateError if it is none."""
    if not isinstance(value, dict):
        raise CertificateError(f"{shown(value)} is not an object with {', '.join(names)}.")
    for name in names:
        if name not in value:
            raise CertificateError(f"{name!r} is missing.")
    for name in value:
        if name not in names:
            raise CertificateError(f"the key {shown(name)} is unknown.")
    return value


def _equation(value: Any) -> tuple[Any, tuple[int, ...]]:
    """Return kind and place; the record decides whether there is such an equation."""
    if isinstance(value, dict) and value.get("kind") == "row-sum":
        return "row-sum", (fields_of(value, "kind", "row")["row"],)
    fields = fields_of(value, "kind", "entry")
    return fields["kind"], at("entry", list_of(_same), fields["entry"])


def _placed(equation: tuple[Any, tuple[int, ...]], **parts: Any) -> Multiplier:
    kind, place = equation
    return Multiplier(kind=kind, place=place, **parts)


def _record(make: Callable[..., Record], **parts: Reader[Any]) -> Reader[Record]:
    """Return the reader of an object with exactly these parts."""

    def read_record(value: Any) -> Record:
        fields = fields_of(value, *parts)
        return make(
            **{name: at(name, read_one, fields[name]) for name, read_one in parts.items()}
        )

    return read_record


def list_of(read_one: Reader[Record]) -> Reader[tuple[Record, ...]]:
    """Return the reader of a list; each part is read by `read_one`."""

    def read_all(value: Any) -> tuple[Record, ...]:
        if not isinstance(value, list):
            raise CertificateError(f"{shown(value)} is not a list.")
        return tuple(at(f"[{place}]", read_one, item) for place, item in enumerate(value))

    return read_all


def at(place: str, read_one: Reader[Record], value: Any) -> Record:
    """Read a part; if it is refused, put its place into the message."""
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
        raise CertificateError(f"an integer of {len(digits)} digits is too long.")
    return int(digits)


def _same(value: Any) -> Any:
    """Return a value as it is: the record that it becomes a part of checks it."""
    return value


def _number_term(value: Any) -> tuple[Fraction, tuple[Any, ...]]:
    """Read a coefficient and the indices of roots; the record checks the indices."""
    if not isinstance(value, list) or len(value) != 2:
        raise CertificateError(f"{shown(value)} is not a list of a coefficient and its roots.")
    return _rational(value[0]), list_of(_same)(value[1])


_pairs = list_of(list_of(_same))
_monomial: dict[str, Reader[Any]] = {"coefficient": _rational, "w": _pairs, "wbar": _pairs}
_term = _record(Term, **_monomial)
_square = _record(Square, weight=_rational, terms=list_of(_term))
_multiplier = _record(_placed, equation=_equation, **_monomial)
_certificate = _record(
    Certificate,
    joints=_same,
    constant=_rational,
    squares=list_of(_square),
    multipliers=list_of(_multiplier),
)
_number = list_of(_number_term)
_exact_jacobian = _record(
    ExactJacobian,
    joints=_same,
    six_joint_arms=_same,
    roots=list_of(_number),
    columns=list_of(list_of(_number)),
)
