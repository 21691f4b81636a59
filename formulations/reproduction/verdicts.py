"""Verdicts from numbers: each function says what it takes to agree, and when it does not."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import numpy.typing as npt

from formulations.reproduction.rounding import rounded, rounded_twice
from formulations.reproduction.row import Verdict


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


def misprint(print_error: float, corrected_error: float, tolerance: float) -> Verdict:
    """AGREES where the print is right; MISPRINT where it is wrong and the correction right."""
    if print_error <= tolerance:
        return Verdict.AGREES
    return Verdict.MISPRINT if corrected_error <= tolerance else Verdict.MISMATCH


def improvement(paper: float, ours: float, tolerance: float) -> Verdict:
    """IMPROVED where ours is larger by more than the tolerance, AGREES where equal."""
    if ours > paper + tolerance:
        return Verdict.IMPROVED
    return holds(bool(ours >= paper - tolerance))
