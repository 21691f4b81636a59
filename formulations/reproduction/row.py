"""One row of the reproduction: what the paper says, what we find, and how they compare."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt


class Verdict(StrEnum):
    """How the paper's value and ours compare; always computed, see `verdicts`.

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
class Row:
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

    def to_dict(self) -> dict[str, str]:
        """Return the fields as plain text, in the order of the table's columns."""
        return {
            "equation": self.equation,
            "quantity": self.quantity,
            "paper": self.paper,
            "ours": self.ours,
            "verdict": str(self.verdict),
            "note": self.note,
        }


def shown(values: npt.ArrayLike) -> str:
    """Return numbers with seven significant digits, separated by commas."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    return ", ".join(f"{number + 0.0:#.7g}" for number in numbers)


def shown_error(error: float, tolerance: float) -> str:
    """Return 'within tolerance' where it is: digits of rounding noise say nothing."""
    return f"within {tolerance:.0e}" if error <= tolerance else f"off by {shown(error)}"
