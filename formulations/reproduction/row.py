"""One row of the reproduction: what the paper says, what we find, and how they compare.

Each function that returns a `Verdict` states what agreement takes, and what it is otherwise.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.problem import Problem, Solution

# Error up to which exact statements hold. The numbers are of the order of 1, so that rounding
# leaves about 1e-15; a smaller number here would refuse true statements.
ROUNDING = 1e-12
# Error up to which optima hold: Ipopt's tolerance is 1e-8 on log t, σ = √t.
SOLVER = 1e-7


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


def farthest(expected: float) -> Callable[[npt.ArrayLike], str]:
    """Return what shows, of many values, only the one farthest from the expected value."""

    def show(values: npt.ArrayLike) -> str:
        numbers = np.ravel(np.asarray(values, dtype=float))
        return shown(numbers[np.argmax(np.abs(numbers - expected))])

    return show


def holds(claim: bool) -> Verdict:
    """AGREES where the claim is true."""
    return Verdict.AGREES if claim else Verdict.MISMATCH


def equal(paper: npt.ArrayLike, ours: npt.ArrayLike, tolerance: float) -> Verdict:
    """AGREES where all numbers are equal within an absolute tolerance; NaN never is."""
    difference = np.abs(np.asarray(paper, dtype=float) - np.asarray(ours, dtype=float))
    return holds(bool(np.max(difference) <= tolerance))


def printed_digits(paper: Decimal, exact: float, from_print: float | None = None) -> Verdict:
    """Compare to the last printed digit.

    AGREES where the exact value rounds to the print. ROUNDED where instead the same quantity
    of the paper's rounded matrix does (`from_print`), or the exact value does when it is
    rounded twice, to one digit more first.
    """
    if rounded(exact, paper) == paper:
        return Verdict.AGREES
    again = from_print is not None and rounded(from_print, paper) == paper
    twice = rounded(exact, paper.scaleb(-1)).quantize(paper, rounding=ROUND_HALF_UP)
    return Verdict.ROUNDED if again or twice == paper else Verdict.MISMATCH


def rounded(value: float, like: Decimal) -> Decimal:
    """Return `value` with as many decimals as `like`, halves away from zero."""
    if not np.isfinite(value):
        return Decimal("NaN")
    return Decimal(value).quantize(like, rounding=ROUND_HALF_UP)


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


def claim(
    equation: str, quantity: str, paper: str, ours: object, true: bool, note: str = ""
) -> ReproductionRow:
    """Return the row of a claim that is true or not."""
    return ReproductionRow(equation, quantity, paper, str(ours), holds(bool(true)), note)


def within(
    equation: str, quantity: str, paper: str, error: float, note: str = ""
) -> ReproductionRow:
    """Return the row of an exact statement: our error is to be at most `ROUNDING`."""
    return claim(equation, quantity, paper, shown_error(error), error <= ROUNDING, note)


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
    """Return the row of numbers that are to be `equal` to one expected, or each to its own."""
    verdict = equal(expected, values, tolerance)
    return ReproductionRow(equation, quantity, paper, show(values), verdict, note)


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


def search(
    build: Callable[[], Problem],
    sample: Callable[[np.random.Generator], FloatArray],
    starts: int,
    seed: int,
    options: Mapping[str, object] | None = None,
) -> list[Solution]:
    """Solve from random starts in this process, one solution per start; see `multistart`.

    `build` states the program, `sample` draws the variables of a start, shape (variables,), and
    `options` are those of Ipopt. A user's interrupt is raised: numbers of starts of an
    unfinished search would be wrong.
    """
    result = multistart(build, sample, starts=starts, seed=seed, options=options)
    if not result.complete:
        raise KeyboardInterrupt
    return [start.solution for start in result.results]


def optima(solutions: list[Solution]) -> list[FloatArray]:
    """Return the Jacobians, shape (m, n), of the feasible points that the solver converged to.

    The program must have the output ``jacobian``.
    """
    ended = (one for one in solutions if one.status.acceptable and one.feasible)
    return [solution.outputs["jacobian"] for solution in ended]
