"""Read a certificate file strictly: what is not exactly in the format is refused.

Every error message is one sentence with the place and the fault. Sizes are limited before
anything is built, so that no file takes long to read. The reader checks the structure of the
JSON text; the records check the rest.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from formulations.existence.certificate import (
    Certificate,
    CertificateError,
    Multiplier,
    Pairs,
    Square,
    Term,
    shown,
)
from formulations.existence.exact_jacobian import ExactJacobian, Number
from formulations.io.files import read_bytes
from nlp.errors import FileError

FILE_BYTES = 2_000_000
_MOST_VALUES = 500_000
DIGITS = 40
_RATIONAL = re.compile(rf"-?(0|[1-9][0-9]{{0,{DIGITS - 1}}})(/[1-9][0-9]{{0,{DIGITS - 1}}})?")

Record = TypeVar("Record")


def read(path: Path | str) -> Certificate | ExactJacobian:
    """Return the certificate in a file, of nonexistence or, if it has columns, of existence.

    Raises
    ------
    FileError
        If the file cannot be read, is too large, or is not a JSON text in UTF-8.
    CertificateError
        If the JSON text is not a well-formed certificate.
    """
    value = loaded(path)
    if isinstance(value, dict) and "columns" in value:
        return _exact_jacobian(Part(value))
    return _certificate(Part(value))


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


def _distinct_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise CertificateError("a key is given twice in one object.")
    return found


def _short_integer(digits: str) -> int:
    if len(digits) > DIGITS:
        raise CertificateError(f"an integer of {len(digits)} digits is too long.")
    return int(digits)


@dataclass(frozen=True)
class Part:
    """A part of a JSON text and its place. CertificateError if it is not what is asked for."""

    value: Any
    place: str = ""

    def refuse(self, why: str) -> NoReturn:
        """Raise CertificateError with the place and a reason."""
        raise CertificateError(f"{self.place}{why}.")

    def fields(self, *names: str) -> list[Part]:
        """Return the values of an object with exactly these keys."""
        if not isinstance(self.value, dict):
            self.refuse(f"{shown(self.value)} is not an object with {', '.join(names)}")
        for name in names:
            if name not in self.value:
                self.refuse(f"{name!r} is missing")
        for name in self.value:
            if name not in names:
                self.refuse(f"the key {shown(name)} is unknown")
        return [Part(self.value[name], f"{self.place}{name}: ") for name in names]

    def items(self, length: range = range(_MOST_VALUES)) -> list[Part]:
        """Return the items of a list whose length is one of those allowed."""
        if not isinstance(self.value, list):
            self.refuse(f"{shown(self.value)} is not a list")
        if len(self.value) not in length:
            self.refuse(f"a list of {len(self.value)} items, not of {_limits(length)}")
        return [Part(one, f"{self.place}[{k}]: ") for k, one in enumerate(self.value)]

    def whole(self, allowed: range | None = None) -> int:
        """Return a whole number, one of those allowed."""
        if type(self.value) is not int:  # nor True
            self.refuse(f"{shown(self.value)} is not a whole number")
        if allowed is not None and self.value not in allowed:
            self.refuse(f"{self.value} is not {_limits(allowed)}")
        return self.value

    def wholes(self) -> tuple[int, ...]:
        """Return a list of whole numbers."""
        return tuple(one.whole() for one in self.items())

    def pairs(self) -> Pairs:
        """Return a list of pairs of whole numbers."""
        both = (one.items(range(2, 3)) for one in self.items())
        return tuple((first.whole(), second.whole()) for first, second in both)

    def rational(self) -> Fraction:
        """Return a rational number, which stands in a string."""
        if not isinstance(self.value, str) or _RATIONAL.fullmatch(self.value) is None:
            self.refuse(
                f'{shown(self.value)} is not a rational number in a string such as "-3/2", '
                f"with at most {DIGITS} digits above and below"
            )
        return Fraction(self.value)

    def record(self, make: Callable[..., Record], *values: object) -> Record:
        """Return a record of these values, which it checks; the place is said if it refuses."""
        try:
            return make(*values)
        except CertificateError as error:
            raise CertificateError(f"{self.place}{error}") from None


def _limits(allowed: range) -> str:
    least, most = allowed.start, allowed.stop - 1
    return f"{least} to {most}" if least < most else str(least)


def _certificate(part: Part) -> Certificate:
    joints, constant, squares, multipliers = part.fields(
        "joints", "constant", "squares", "multipliers"
    )
    return part.record(
        Certificate,
        joints.whole(),
        constant.rational(),
        tuple(map(_square, squares.items())),
        tuple(map(_multiplier, multipliers.items())),
    )


def _square(part: Part) -> Square:
    weight, terms = part.fields("weight", "terms")
    return part.record(Square, weight.rational(), tuple(map(_term, terms.items())))


def _term(part: Part) -> Term:
    coefficient, w, wbar = part.fields("coefficient", "w", "wbar")
    return part.record(Term, coefficient.rational(), w.pairs(), wbar.pairs())


def _multiplier(part: Part) -> Multiplier:
    coefficient, equation, w, wbar = part.fields("coefficient", "equation", "w", "wbar")
    row_sum = isinstance(equation.value, dict) and equation.value.get("kind") == "row-sum"
    kind, place = equation.fields("kind", "row" if row_sum else "entry")
    where = (place.whole(),) if row_sum else place.wholes()
    values = coefficient.rational(), kind.value, where, w.pairs(), wbar.pairs()
    return part.record(Multiplier, *values)


def _exact_jacobian(part: Part) -> ExactJacobian:
    joints, arms, roots, columns = part.fields("joints", "six_joint_arms", "roots", "columns")
    return part.record(
        ExactJacobian,
        joints.whole(),
        arms.whole(),
        tuple(map(_number, roots.items())),
        tuple(tuple(map(_number, column.items())) for column in columns.items()),
    )


def _number(part: Part) -> Number:
    return tuple(map(_number_term, part.items()))


def _number_term(part: Part) -> tuple[Fraction, tuple[int, ...]]:
    coefficient, roots = part.items(range(2, 3))
    return coefficient.rational(), roots.wholes()
