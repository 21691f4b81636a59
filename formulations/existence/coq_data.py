"""The certificate as the data file of the proof in Coq, `Data.v` in the folder `coq`.

`Checker.v` there works with integers, so all numbers are multiplied by a common denominator.
Its tight-frame equations are seven times those of the certificate; their coefficients are
divided by seven for it. Nothing that Coq proves relies on this module: a wrong file would not
pass the check.
"""

from collections.abc import Iterable
from fractions import Fraction
from math import lcm

from formulations.existence.certificate import Certificate, Multiplier, Pairs, Term

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

    Parameters
    ----------
    certificate
        Its squares have whole coefficients, as those that `derive` finds.
    """
    coefficients = [
        m.coefficient / (7 if m.kind == "tight-frame" else 1) for m in certificate.multipliers
    ]
    weights = [square.weight for square in certificate.squares]
    numbers = [certificate.constant, *coefficients, *weights]
    common = lcm(*(number.denominator for number in numbers))
    definitions = [
        _definition(f"square{k} : polynomial", map(_term, square.terms))
        for k, square in enumerate(certificate.squares)
    ]
    multipliers = (
        f"M {_whole(c * common)} {_equation(m)} {_monomial(m.w, m.wbar)}"
        for c, m in zip(coefficients, certificate.multipliers, strict=True)
    )
    definitions.append(_definition("all_multipliers", multipliers))
    squares = "; ".join(f"({_whole(w * common)}%Z, square{k})" for k, w in enumerate(weights))
    return (
        _HEAD.format(common=common)
        + "".join(definitions)
        + "Definition proof : certificate := Certificate "
        + f"{_whole(certificate.constant * common)} [{squares}] all_multipliers.\n"
    )


def _definition(name: str, items: Iterable[str]) -> str:
    lines = ";\n".join(items)
    return f"Definition {name} := [\n{lines}].\n"


def _term(term: Term) -> str:
    return f"T {_whole(term.coefficient)} {_monomial(term.w, term.wbar)}"


def _equation(multiplier: Multiplier) -> str:
    return f"({_EQUATIONS[multiplier.kind]} {' '.join(map(str, multiplier.place))})"


def _monomial(w: Pairs, wbar: Pairs) -> str:
    return f"(Monomial {_edges(w)} {_edges(wbar)})"


def _edges(pairs: Pairs) -> str:
    return "[" + ";".join(f"({i},{j})" for i, j in pairs) + "]"


def _whole(number: Fraction) -> str:
    if number.denominator != 1:
        raise ValueError(f"{number} is not a whole number")
    return f"({number})" if number < 0 else str(number)
