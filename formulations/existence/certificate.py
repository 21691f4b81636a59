"""The certificate that no optimally failure-tolerant 7R exists: its records, and its JSON text.

A record that exists is well-formed: what is not is refused when it is made. Whether the
identity holds is for `verify` to say.

W = ZᵀZ with Z = V + iΩ, where v_i and ω_i are the columns of V and Ω, 3×7, for joint i. For an
optimally failure-tolerant 7R all three equations below are zero, and |Σ terms|² is not
negative.

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

#: The number of joints that the theorem is about.
JOINTS = 7
# The limits below are on what a file may ask for: the certificate on record is far smaller.
#
# The largest number of entries of W, conjugate or not, in a term of a square.
_TERM_FACTORS = 3
# The largest number of entries of W, conjugate or not, that an equation is multiplied with.
_MONOMIAL_FACTORS = 5
#: The largest number of squares.
SQUARES = 4
#: The largest number of terms of a square.
TERMS = 200
#: The largest number of multipliers.
MULTIPLIERS = 1000
# The largest common denominator of all numbers.
_COMMON_DENOMINATOR = 10**60
# A message shows at most so many characters of a value.
_SHOWN_CHARACTERS = 60

#: The indices (i, j) of factors W_ij, joints counted from 0.
Pairs: TypeAlias = tuple[tuple[int, int], ...]
#: The kinds of equations of W, see above.
EquationKind: TypeAlias = Literal["row-sum", "square", "tight-frame"]


class CertificateError(LockedJointError):
    """A certificate that is ill-formed, or whose equations do not hold.

    Examples
    --------
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> _ = Path("empty.json").write_text("{}")
    >>> try:
    ...     lj.read_certificate("empty.json")
    ... except lj.CertificateError as error:
    ...     print(error.exit_status)
    1
    """

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
    """A rational coefficient times a monomial times an equation.

    The equation has a `kind`, and a `place`: a row (i,) or an entry (i, j).
    """

    coefficient: Fraction
    kind: EquationKind
    place: tuple[int, ...]
    w: Pairs
    wbar: Pairs

    def __post_init__(self) -> None:
        require(
            self.kind in get_args(EquationKind), f"equation kind {shown(self.kind)} is unknown"
        )
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
    """Return the JSON text of a list of records, one a line."""
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
    return text if len(text) <= _SHOWN_CHARACTERS else text[: _SHOWN_CHARACTERS - 1] + "…"


def require(condition: bool, otherwise: str) -> None:
    """Raise CertificateError with a reason unless the condition holds."""
    if not condition:
        raise CertificateError(f"{otherwise}.")


def _require_rational(name: str, number: object) -> None:
    """Raise CertificateError unless a number, which has a name, is a Fraction."""
    require(isinstance(number, Fraction), f"{name} {number} is not a Fraction")


def _require_length(name: str, items: tuple[object, ...], most: int) -> None:
    """Raise CertificateError unless there are 1 to `most` items, which have a name."""
    require(0 < len(items) <= most, f"{len(items)} {name} are not 1 to {most}")


def _require_monomial(coefficient: Fraction, w: Pairs, wbar: Pairs, factors: int) -> None:
    """Raise CertificateError unless this is a term of at most so many factors."""
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
    """Raise CertificateError unless all are joints, counted from 0."""
    for joint in joints:
        require(joint in range(JOINTS), f"joint {joint} is not one of 0 to {JOINTS - 1}")
