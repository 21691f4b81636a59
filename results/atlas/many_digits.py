"""Optima to many digits: residuals have all of them, inverses are in double precision."""

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath as mp
import numpy as np
import scipy.optimize

from formulations.atlas.entry import EntryPage
from formulations.atlas.local_maximum import Conditions, LocalMaximum
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray

_CHOICES = 4
# Multipliers are at least this share of the mean one, where all are to be above zero.
_LEAST = 1e-3

numbers = np.frompyfunc(mp.mpf, 1, 1)


def refined(
    residual: Callable[[Any], Any], step: Callable[[FloatArray], Any], start: Any
) -> Any:
    """Return where a residual vanishes to all digits, or raise ArithmeticError."""
    x = start
    for _ in range(mp.mp.dps):
        rest = residual(x)
        largest = max(abs(v) for v in rest)
        if largest < mp.mpf(10) ** (8 - mp.mp.dps):
            return x
        if largest > 10:
            break
        x = x - largest * step((rest / largest).astype(float))
    raise ArithmeticError("Newton's method does not converge")


def nearest_solution(matrix: Any, right: Any, start: Any) -> Any:
    """Return the solution of linear equations that is nearest to a start."""
    inverse = np.linalg.pinv((matrix @ matrix.T).astype(float), rcond=1e-12, hermitian=True)
    return refined(
        lambda x: matrix @ x - right, lambda rest: matrix.T @ numbers(inverse @ rest), start
    )


def solution(page: EntryPage, maximum: LocalMaximum | None) -> tuple[Any, Any]:
    """Return J and t of the optimum next to an entry, or raise ArithmeticError."""
    refused = ArithmeticError("no conditions")
    for choice in range(_CHOICES):
        try:
            kind = Conditions if maximum else _AllTied
            conditions = kind(page.entry, page.jacobian, choice)
            if maximum and not np.array_equal(conditions.kept, maximum.kept):
                continue
            x = conditions.solution()
            # Multipliers that are not unique leave a null space; steps are normal to it.
            inverse = np.linalg.pinv(conditions.slope(x), rcond=1e-10)
            residual = partial(conditions.gradient_in, numbers)
            found = refined(residual, partial(np.matmul, inverse), numbers(x))
            j, _, _, t, _ = conditions.parts(found)
        except (ArithmeticError, CertificateError, np.linalg.LinAlgError) as error:
            refused = ArithmeticError(str(error))
        else:
            return j, t
    raise refused


class _AllTied(Conditions):
    """All sets at the worst case have multipliers above zero, so that all are equations."""

    def multipliers(self, columns: FloatArray, choice: int) -> FloatArray:  # noqa: ARG002
        size = columns.shape[1]
        sought = np.eye(len(columns))[-1]
        found = scipy.optimize.lsq_linear(columns, sought, (_LEAST / size, np.inf))
        # What is on file is not exact.
        if np.linalg.norm(found.fun) > 1e-4:
            raise CertificateError("some multipliers are zero")
        return np.asarray(found.x)
