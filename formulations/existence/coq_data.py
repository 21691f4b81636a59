"""The certificate as a source file for Coq.

What comes in: a `Certificate` in fractions. What goes out: the text of `coq/Data.v`, in
integers, as `coq/Checker.v` reads it.
"""

from fractions import Fraction
from math import lcm

from lockedjoint.formulations.existence.certificate import Certificate, Multiplier, Term

# The names in `Checker.v` of the kinds of equations.
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
    """Return the monomial of a record: the pairs of W, and those of conj(W)."""
    both = (";".join(f"({i},{j})" for i, j in pairs) for pairs in (record.w, record.wbar))
    return "(Monomial [{}] [{}])".format(*both)


def _whole(number: Fraction) -> str:
    """Return a whole number as Coq reads it; negative ones are in brackets."""
    if number.denominator != 1:
        raise ValueError(f"{number} is not a whole number")
    return f"({number})" if number < 0 else str(number)
