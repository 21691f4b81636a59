"""The certificate: records that are well-formed once they exist, and the file they go to.

For every complex symmetric 7×7 matrix W with zero diagonal the average over all orders of

    Re( Σ weight · |Σ terms|² + constant − Σ coefficient · monomial · equation )

is identically zero, where the equations are row-sum i: Σ_j W_ij, square (i, j): (W²)_ij and
tight-frame (i, j): (W conj(W) + conj(W) W)_ij − 4(δ_ij − 1/7) (docs/nonexistence.md, section
5).
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any, ClassVar, Literal, TypeAlias, get_args

from lockedjoint.nlp.errors import LockedJointError

# Limits on what a certificate may hold.
JOINTS = 7
_TERM_FACTORS = 3
_MONOMIAL_FACTORS = 5
SQUARES = 4
TERMS = 200
MULTIPLIERS = 1000
_COMMON_DENOMINATOR = 10**60

Pairs: TypeAlias = tuple[tuple[int, int], ...]
Kind: TypeAlias = Literal["row-sum", "square", "tight-frame"]


class CertificateError(LockedJointError):
    """A certificate that is ill-formed, or whose equations do not hold."""

    exit_status: ClassVar[int] = 1


@dataclass(frozen=True, slots=True)
class Term:
    """A rational coefficient times a product of entries W_ij (`w`) and conj(W_ij) (`wbar`)."""

    coefficient: Fraction
    w: Pairs
    wbar: Pairs

    def __post_init__(self) -> None:
        _require_monomial(self.coefficient, self.w, self.wbar, _TERM_FACTORS)


@dataclass(frozen=True, slots=True)
class Square:
    """A positive weight times the squared modulus of a sum of terms."""

    weight: Fraction
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        _require_rational("weight", self.weight)
        require(self.weight > 0, f"weight {self.weight} is not positive")
        _require_length("terms", self.terms, TERMS)


@dataclass(frozen=True, slots=True)
class Multiplier:
    """A rational coefficient times a monomial times an equation at a row or an entry."""

    coefficient: Fraction
    kind: Kind
    place: tuple[int, ...]
    w: Pairs
    wbar: Pairs

    def __post_init__(self) -> None:
        require(self.kind in get_args(Kind), f"equation kind {shown(self.kind)} is unknown")
        indices = 1 if self.kind == "row-sum" else 2
        require(len(self.place) == indices, f"a {self.kind} equation has {indices} indices")
        _require_joints(self.place)
        _require_monomial(self.coefficient, self.w, self.wbar, _MONOMIAL_FACTORS)


@dataclass(frozen=True, slots=True)
class Certificate:
    """A sum of squares plus a positive constant that should vanish modulo the equations."""

    joints: int
    constant: Fraction
    squares: tuple[Square, ...]
    multipliers: tuple[Multiplier, ...]

    def __post_init__(self) -> None:
        require(
            self.joints == JOINTS, f"joints is {self.joints}, but the theorem is about {JOINTS}"
        )
        _require_rational("constant", self.constant)
        require(self.constant > 0, f"constant {self.constant} is not positive")
        _require_length("squares", self.squares, SQUARES)
        _require_length("multipliers", self.multipliers, MULTIPLIERS)
        # Sums of other numbers could have very large denominators.
        numbers = [self.constant, *(square.weight for square in self.squares)]
        numbers += [term.coefficient for square in self.squares for term in square.terms]
        numbers += [multiplier.coefficient for multiplier in self.multipliers]
        common = lcm(*(number.denominator for number in numbers))
        require(common <= _COMMON_DENOMINATOR, "the denominators have no small multiple")

    def to_json(self) -> str:
        """Return the JSON text, one term or multiplier per line."""
        squares = ",\n".join(
            f'  {{"weight": "{square.weight}", "terms": {_lines(square.terms, 3)}}}'
            for square in self.squares
        )
        return (
            f'{{"joints": {self.joints},\n "constant": "{self.constant}",\n'
            f' "squares": [\n{squares}],\n'
            f' "multipliers": {_lines(self.multipliers, 2)}}}\n'
        )


def _lines(records: Iterable[Term | Multiplier], indent: int) -> str:
    lines = []
    for record in records:
        plain: dict[str, Any] = {"coefficient": str(record.coefficient)}
        if isinstance(record, Multiplier):
            row_sum = record.kind == "row-sum"
            place = {"row": record.place[0]} if row_sum else {"entry": record.place}
            plain["equation"] = {"kind": record.kind, **place}
        lines.append(json.dumps({**plain, "w": record.w, "wbar": record.wbar}))
    margin = "\n" + " " * indent
    return f"[{margin}{f',{margin}'.join(lines)}]"


def shown(value: object) -> str:
    """Return a value as it stands in JSON, shortened, for a message about it."""
    if isinstance(value, (list, tuple, dict)):
        return "an object" if isinstance(value, dict) else "a list"
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:59] + "…"


def require(condition: bool, otherwise: str) -> None:
    """Raise CertificateError with a reason unless the condition holds."""
    if not condition:
        raise CertificateError(f"{otherwise}.")


def _require_rational(name: str, number: object) -> None:
    require(isinstance(number, Fraction), f"{name} {number} is not a Fraction")


def _require_length(name: str, items: tuple[object, ...], most: int) -> None:
    require(0 < len(items) <= most, f"{len(items)} {name} are not 1 to {most}")


def _require_monomial(coefficient: Fraction, w: Pairs, wbar: Pairs, factors: int) -> None:
    _require_rational("coefficient", coefficient)
    require(coefficient != 0, "a coefficient is zero")
    count = len(w) + len(wbar)
    require(count <= factors, f"a monomial of {count} factors is longer than {factors}")
    for pair in w + wbar:
        _require_joints(pair)
        require(
            pair[0] != pair[1], f"the pair {list(pair)} is on the diagonal, where W is zero"
        )


def _require_joints(joints: tuple[int, ...]) -> None:
    for joint in joints:
        require(joint in range(JOINTS), f"joint {joint} is not one of 0 to {JOINTS - 1}")


_EQUATIONS = {"row-sum": "RowSum", "square": "Square", "tight-frame": "TightFrame"}
_HEAD = """\
(** Written by `lockedjoint prove --to coq`. The constant, the weights and the coefficients of
    the multipliers are those of the certificate times {common}; those of tight-frame equations
    are divided by 7, because Checker.v multiplies these equations by 7. *)
From Coq Require Import ZArith List.
Import ListNotations.
From Lockedjoint Require Import Checker.

Definition T (c : Z) (m : monomial) := (c, m).
Definition M (c : Z) (e : equation) (m : monomial) := (c, m, e).
"""


def coq_data(certificate: Certificate) -> str:
    """Return the text of `Data.v`, which defines the certificate `proof` for `Checker.v`.

    That works with integers: numbers are multiplied by a common denominator, and coefficients
    of tight-frame equations divided by seven, as its equations are seven times those here.
    """
    multipliers = certificate.multipliers
    coefficients = [m.coefficient / (7 if m.kind == "tight-frame" else 1) for m in multipliers]
    weights = [square.weight for square in certificate.squares]
    numbers = [certificate.constant, *coefficients, *weights]
    common = lcm(*(number.denominator for number in numbers))
    definitions = {
        f"square{k} : polynomial": [f"T {_whole(t.coefficient)} {_edges(t)}" for t in s.terms]
        for k, s in enumerate(certificate.squares)
    }
    equations = [" ".join([_EQUATIONS[m.kind], *map(str, m.place)]) for m in multipliers]
    definitions["all_multipliers"] = [
        f"M {_whole(c * common)} ({equation}) {_edges(m)}"
        for c, equation, m in zip(coefficients, equations, multipliers, strict=True)
    ]
    lists = (f"{name} := [\n" + ";\n".join(items) for name, items in definitions.items())
    squares = "; ".join(f"({_whole(w * common)}%Z, square{k})" for k, w in enumerate(weights))
    return (
        _HEAD.format(common=common)
        + "".join(f"Definition {one}].\n" for one in lists)
        + "Definition proof : certificate := Certificate "
        + f"{_whole(certificate.constant * common)} [{squares}] all_multipliers.\n"
    )


def _edges(record: Term | Multiplier) -> str:
    both = (";".join(f"({i},{j})" for i, j in pairs) for pairs in (record.w, record.wbar))
    return "(Monomial [{}] [{}])".format(*both)


def _whole(number: Fraction) -> str:
    if number.denominator != 1:
        raise ValueError(f"{number} is not a whole number")
    return f"({number})" if number < 0 else str(number)
