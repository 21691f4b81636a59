"""Read a certificate file strictly: what is not exactly in the format is refused.

Every message is one sentence with the place and the fault. Sizes are limited before anything is
built. The reader checks the structure of the JSON text; the records check the rest.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn, get_args, get_origin, get_type_hints

from lockedjoint.formulations.existence.certificate import (
    Certificate,
    CertificateError,
    Multiplier,
    Pairs,
    shown,
)
from lockedjoint.formulations.existence.exact_jacobian import ExactJacobian
from lockedjoint.formulations.io.files import load_json, read_bytes
from lockedjoint.nlp.errors import FileError, printable

#: Largest size of a file in bytes. The certificate of 7R has 58 kB.
FILE_BYTES = 2_000_000
# Largest number of values in a file: lists, objects and what is in them.
_MOST_VALUES = 500_000
#: Largest number of digits of a whole number, a numerator or a denominator.
DIGITS = 40
_RATIONAL = re.compile(rf"-?(0|[1-9][0-9]{{0,{DIGITS - 1}}})(/[1-9][0-9]{{0,{DIGITS - 1}}})?")


def read_certificate(path: Path | str) -> Certificate | ExactJacobian:
    """Return the certificate in a file, of nonexistence or of existence.

    Parameters
    ----------
    path
        A JSON file.

    Returns
    -------
    Certificate or ExactJacobian
        An `ExactJacobian` if the file has columns. It is well-formed, but not yet verified.

    Raises
    ------
    FileError
        If the file cannot be read or is no JSON text.
    CertificateError
        If the certificate is ill-formed.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> from importlib.resources import files
    >>> shipped = files("lockedjoint.formulations.existence") / "certificate.json"
    >>> type(lj.read_certificate(shipped)).__name__
    'Certificate'
    """
    value = loaded(path)
    if _holds_jacobian(value):
        raise CertificateError(
            f"{printable(str(path))} is no certificate; it holds a Jacobian, "
            f"which `lockedjoint measure {printable(str(path))}` measures."
        )
    existence = isinstance(value, dict) and "columns" in value
    found: Certificate | ExactJacobian = Part(value).read(
        ExactJacobian if existence else Certificate
    )
    return found


def _holds_jacobian(value: Any) -> bool:
    """Whether a JSON text is a Jacobian with its measures, or a list of these."""
    first = value[0] if isinstance(value, list) and value else value
    return isinstance(first, dict) and "jacobian" in first


def loaded(path: Path | str, most: int = FILE_BYTES) -> Any:
    """Return what the JSON text in a file of at most `most` bytes says, or raise FileError."""
    content = read_bytes(Path(path), most=most)
    if sum(map(content.count, (b",", b"[", b"{"))) > _MOST_VALUES:
        raise FileError("file", str(path), f"a file of at most {_MOST_VALUES} values")
    return load_json(content, Path(path))


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
        if type(self.value) is not int or abs(self.value) >= 10**DIGITS:  # nor True
            self.refuse(f"{shown(self.value)} is not a whole number of at most {DIGITS} digits")
        if allowed is not None and self.value not in allowed:
            self.refuse(f"{self.value} is not {_limits(allowed)}")
        return self.value

    def number(self, most: float) -> float:
        """Return a decimal number, not larger in size than `most`."""
        value = self.value
        if not isinstance(value, float) or not abs(value) <= most:
            self.refuse(f"{shown(value)} is not a decimal number up to {most:g}")
        return value

    def rational(self) -> Fraction:
        """Return a rational number, which stands in a string."""
        if not isinstance(self.value, str) or _RATIONAL.fullmatch(self.value) is None:
            self.refuse(
                f'{shown(self.value)} is not a rational number in a string such as "-3/2", '
                f"with at most {DIGITS} digits above and below"
            )
        return Fraction(self.value)

    def read(self, kind: Any) -> Any:
        """Return a value of a tuple type, or a record with fields named as keys."""
        if kind in (int, Fraction):
            return self.whole() if kind is int else self.rational()
        if get_origin(kind) is tuple:
            kinds = get_args(kind)
            if Ellipsis in kinds:
                return tuple(one.read(kinds[0]) for one in self.items())
            both = self.items(range(len(kinds), len(kinds) + 1))
            return tuple(one.read(own) for one, own in zip(both, kinds, strict=True))
        if kind is Multiplier:
            values = self._multiplier()
        else:
            hints = get_type_hints(kind)
            parts = zip(self.fields(*hints), hints.values(), strict=True)
            values = [one.read(own) for one, own in parts]
        try:
            return kind(*values)
        except CertificateError as error:
            raise CertificateError(f"{self.place}{error}") from None

    def _multiplier(self) -> list[Any]:
        """Return the values of a multiplier, whose equation is an object of its own."""
        coefficient, equation, w, wbar = self.fields("coefficient", "equation", "w", "wbar")
        row_sum = isinstance(equation.value, dict) and equation.value.get("kind") == "row-sum"
        kind, place = equation.fields("kind", "row" if row_sum else "entry")
        where = (place.whole(),) if row_sum else place.read(tuple[int, ...])
        return [coefficient.rational(), kind.value, where, w.read(Pairs), wbar.read(Pairs)]


def _limits(allowed: range) -> str:
    """Return a range in words."""
    least, most = allowed.start, allowed.stop - 1
    return f"{least} to {most}" if least < most else str(least)
