"""Search for the exact values of the atlas: Newton's method to many digits, then PARI/GP.

What comes in: pages of entries, with Jacobians in double precision. What goes out: records of
exact optima, as `exact_optimum` reads and `exact_proof` proves them.

Optima of free columns are recognised as a whole, in one number field. Of other models only the
polynomial of t is found. The letters are those of `exact_optimum`; f is a joint, F a set of
locked joints after whose loss the worst case is least, and "sets" the number of these F:

- J: the Jacobian, shape (m, n); its columns are j_f = ±√w_f B x_f. t: the squared worst case;
- B: a frame of the task space, shape (m, m). S = BᵀB: its Gram matrix, ``gram``;
- x_f: coordinates of column f in the frame, up to a scale: the columns of ``coordinates``,
  shape (m, n). w_f: the square of this scale, ``squared_scales``, shape (n,);
- v_F: null vector of M_F = Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹: the rows of ``eigenvectors``, shape
  (sets, m). u_F = B⁻ᵀv_F is the eigenvector at t of JJᵀ without the columns F;
- c_F: multiplier of set F, ``multipliers``, shape (sets,). It is 0 if F is not needed;
- θ: generator of the field, a root of its monic polynomial, ``field``.

Arrays of numbers with many digits have the dtype object and hold `mpmath.mpf`: `DigitArray`.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import mpmath as mp
from cypari import pari

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import proved_maximum, read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas import many_digits
from results.atlas.digit_optimum import digit_optimum
from results.atlas.exact_optimum import records, write_records
from results.atlas.exact_proof import prove_exact_value
from results.atlas.frame_invariants import DigitArray, DigitNumber
from results.atlas.many_digits import NumberTable

# Number of significant digits of `near`, the decimal value of t that is shown.
_SHOWN_DIGITS = 20
# Number of decimal digits of the rational number near θ.
_ROOT_DIGITS = 15
# Largest distance of this number from θ, as a fraction: more than its rounding.
_ROOT_RADIUS = "1/100000000000000"


def find(names: Sequence[str], digits: Sequence[int]) -> None:
    """Find the exact values of some entries, or of all, and write both files.

    Polynomials are sought with the first number of digits, and of free columns with the next
    one if that is not enough.
    """
    found = dict(records())
    for page in read_atlas():
        name = page.entry.name
        isolated = page.family == 0 and page.entry.formulation == max_min.NAME
        if not isolated or (names and name not in names):
            continue
        found.pop(name, None)
        for number in digits if page.entry.model.startswith("free") else digits[:1]:
            mp.mp.dps = number
            pari.set_real_precision(number)
            try:
                record = found[name] = found_record(page)
                result = f"degree {len(record['polynomial']) - 1}, {record['proof']}"
            except ArithmeticError as error:
                result = str(error)
            print(name, f"{number} digits:", result, flush=True)
            if name in found and found[name]["proof"] != "numerical":
                break
        write_records(found)


def found_record(page: EntryPage) -> dict[str, Any]:
    """Return the record of an entry, with the most that is proved; or raise ArithmeticError."""
    maximum = proved_maximum(page.entry, page.jacobian)
    jacobian, t = many_digits.solution(page, maximum)
    polynomial = many_digits.algebraic(t)
    near = mp.nstr(t, _SHOWN_DIGITS)
    record = {"polynomial": polynomial, "near": near, "proof": "numerical"}
    if not page.entry.model.startswith("free"):
        return record
    try:
        optimum = recognised(page, jacobian, t, polynomial, maximum)
    except ArithmeticError as error:
        print("  ", page.entry.name, error)
        return record
    # The order is from the most that can be proved to the least.
    for proof in ("maximum", "sharp maximum", "attained"):
        stated = {**record, **optimum, "proof": proof}
        try:
            prove_exact_value(page.entry, page.jacobian, maximum, stated)
        except CertificateError as error:
            print("  ", page.entry.name, error)
        else:
            return stated
    return record


def recognised(
    page: EntryPage,
    jacobian: DigitArray,
    t: DigitNumber,
    polynomial: list[int],
    maximum: LocalMaximum | None,
) -> dict[str, Any]:
    """Return the exact optimum next to a Jacobian of many digits, as it is on file.

    Parameters
    ----------
    page
        The entry with its Jacobian in double precision.
    jacobian
        J, shape (m, n).
    t
        The squared worst case.
    polynomial
        The integer polynomial of t, constant first.
    maximum
        The local maximum that the library proves; None if it proves none.

    Raises
    ------
    ArithmeticError
        If its numbers are not recognised.
    """
    optimum = digit_optimum(page, jacobian, t, maximum)
    why = ""
    for theta, field in many_digits.fields(t, polynomial, optimum.scalars):
        table = NumberTable(theta, len(field) - 1)
        try:
            recorded = optimum.recorded(table)
        except ArithmeticError as error:
            why = str(error)
            continue
        near = Fraction(int(mp.nint(theta * 10**_ROOT_DIGITS)), 10**_ROOT_DIGITS)
        root = [str(near), _ROOT_RADIUS]
        return {"field": field, "root": root, "numbers": table.numbers, **recorded}
    raise ArithmeticError(f"{why} ({len(optimum.remaining)} sets)")
