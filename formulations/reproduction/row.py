"""One row of the reproduction: what the paper says, what we find, and how they compare.

Each function that returns a `Verdict` states what agreement takes, and what it is otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from formulations.reproduction.printed import rounded, rounded_twice

# Exact statements hold up to this; optima up to this, as Ipopt's tolerance is 1e-8 on log t.
ROUNDING, SOLVER = 1e-12, 1e-7


class Verdict(StrEnum):
    """How the paper's value and ours compare; always computed.

    AGREES: equal to all printed digits, or the claim holds.
    MISPRINT: the print is wrong and a corrected form is right; both are computed.
    ROUNDED: the print follows from rounded numbers and differs from the exact value.
    IMPROVED: we find better than the paper.
    MISMATCH: none of these; unexplained.
    """

    AGREES = "agrees"
    MISPRINT = "misprint"
    ROUNDED = "rounded"
    IMPROVED = "improved"
    MISMATCH = "mismatch"


@dataclass(frozen=True)
class ReproductionRow:
    """One numbered example or claim of the paper.

    Attributes
    ----------
    equation
        Equation number, figure or section.
    quantity
        What is compared.
    paper, ours
        The paper's value and ours, as text.
    verdict
        How they compare.
    note
        The reason, in a sentence.
    """

    equation: str
    quantity: str
    paper: str
    ours: str
    verdict: Verdict
    note: str = ""


def shown(values: npt.ArrayLike) -> str:
    """Return numbers with seven significant digits, separated by commas."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    return ", ".join(f"{number + 0.0:#.7g}" for number in numbers)


def shown_range(values: npt.ArrayLike) -> str:
    """Return the smallest and the largest number."""
    return f"{shown(np.min(values))} to {shown(np.max(values))}"


def shown_error(error: float, tolerance: float = ROUNDING) -> str:
    """Return 'within tolerance' where it is: digits of rounding noise mean nothing."""
    return f"within {tolerance:.0e}" if error <= tolerance else f"off by {shown(error)}"


def compared(
    equation: str,
    quantity: str,
    paper: str,
    expected: npt.ArrayLike,
    values: npt.ArrayLike,
    note: str = "",
    tolerance: float = ROUNDING,
    show: Callable[[npt.ArrayLike], str] = shown,
) -> ReproductionRow:
    """Return the row of numbers that are to be equal to those expected; see `equal`.

    Parameters
    ----------
    equation, quantity, paper, note
        Of the row.
    expected
        One number for all values, or one for each.
    values
        Ours.
    tolerance
        Largest difference of numbers that agree.
    show
        How our values are written.
    """
    return ReproductionRow(
        equation, quantity, paper, show(values), equal(expected, values, tolerance), note
    )


def within(
    equation: str, quantity: str, paper: str, error: float, note: str = ""
) -> ReproductionRow:
    """Return the row of an exact statement: our error is to be at most `ROUNDING`."""
    return claim(equation, quantity, paper, shown_error(error), error <= ROUNDING, note)


def claim(
    equation: str, quantity: str, paper: str, ours: object, true: bool, note: str = ""
) -> ReproductionRow:
    """Return the row of a claim that is true or not."""
    return ReproductionRow(equation, quantity, paper, str(ours), holds(true), note)


def to_last_digit(
    equation: str,
    quantity: str,
    paper: Decimal,
    exact: float,
    from_print: float | None = None,
    note: str = "",
) -> ReproductionRow:
    """Return the row of a number printed with decimals; see `printed_digits`."""
    verdict = printed_digits(paper, exact, from_print)
    return ReproductionRow(equation, quantity, str(paper), shown(exact), verdict, note)


def farthest(expected: float) -> Callable[[npt.ArrayLike], str]:
    """Return what shows, of many values, only the one farthest from the expected value."""

    def show(values: npt.ArrayLike) -> str:
        numbers = np.ravel(np.asarray(values, dtype=float))
        return shown(numbers[np.argmax(np.abs(numbers - expected))])

    return show


def equal(paper: npt.ArrayLike, ours: npt.ArrayLike, tolerance: float) -> Verdict:
    """AGREES where all numbers are equal within an absolute tolerance; NaN never is."""
    difference = np.abs(np.asarray(paper, dtype=float) - np.asarray(ours, dtype=float))
    return holds(bool(np.max(difference) <= tolerance))


def holds(claim: bool) -> Verdict:
    """AGREES where the claim is true."""
    return Verdict.AGREES if claim else Verdict.MISMATCH


def printed_digits(paper: Decimal, exact: float, from_print: float | None = None) -> Verdict:
    """Compare to the last printed digit.

    AGREES where the exact value rounds to the print. ROUNDED where instead the same quantity
    of the paper's rounded matrix does (`from_print`), or the exact value does when it is
    rounded twice, to one digit more first.
    """
    if rounded(exact, paper) == paper:
        return Verdict.AGREES
    again = from_print is not None and rounded(from_print, paper) == paper
    if again or rounded_twice(exact, paper) == paper:
        return Verdict.ROUNDED
    return Verdict.MISMATCH


def misprint(print_error: float, corrected_error: float) -> Verdict:
    """AGREES where the print is right; MISPRINT where it is wrong and the correction right."""
    if print_error <= ROUNDING:
        return Verdict.AGREES
    return Verdict.MISPRINT if corrected_error <= ROUNDING else Verdict.MISMATCH


def improvement(paper: float, ours: float, tolerance: float) -> Verdict:
    """IMPROVED where ours is larger by more than the tolerance, AGREES where equal."""
    if ours > paper + tolerance:
        return Verdict.IMPROVED
    return holds(bool(ours >= paper - tolerance))
