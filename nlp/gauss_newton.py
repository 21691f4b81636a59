"""Gauss–Newton steps on a sum of squares r(x)ᵀr(x) of few rows of many variables.

::

    step  −Aᵀ (AAᵀ + ½μI)⁻¹ r,     A = ∂r/∂x,  μ = ‖r‖/√50 + 1e-8

which is −(2AᵀA + μI)⁻¹ 2Aᵀr, with a system as large as the rows and not as the variables; it is
halved until the sum falls. r has R rows, x N variables, A the shape (R, N). Without bounds and
constraints a general solver takes the same steps, and spends nine tenths of its time on what
surrounds them.
"""

import math
import time

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.compiled import compiled_function
from lockedjoint.nlp.problem import INVALID, LIMIT, SUCCESS, Buffered, Status

#: The status where no step makes the sum smaller; others are those of `nlp.problem`.
STALLED = "Gauss_Newton_Stalled"
# ‖r‖ up to which the rows count as zero. A larger number ends earlier, and less exactly.
_TOLERANCE = 1e-9
# Factor of ‖r‖ in μ, 1/√50. More of it makes shorter steps, less of it longer ones that fail
# more often.
_SHIFT = math.sqrt(0.02)
# What μ is where r is zero, so that the matrix stays regular.
_LEAST_SHIFT = 1e-8
# Number of lengths of a step that are tried, each half of the one before.
_LENGTHS = 10


class GaussNewton:
    """Gauss–Newton steps for rows r of variables x.

    Parameters
    ----------
    variables
        x, a column of N symbols.
    rows
        r, a column of R expressions.
    most
        Largest number of steps.
    compiled
        Whether r and A are compiled to machine code, where there is a compiler.
    """

    def __init__(self, variables: ca.SX, rows: ca.SX, most: int, compiled: bool) -> None:
        from scipy.linalg.lapack import dposv

        # LAPACK's solution of a positive definite system.
        self._solve = dposv
        slopes = ca.densify(ca.jacobian(rows, variables))
        function = ca.Function("rows", [variables], [ca.densify(rows), slopes])
        function = (compiled_function(function) if compiled else None) or function
        self._most, self._point = most, np.zeros(variables.numel())
        self._rows = np.zeros(rows.numel())
        # Aᵀ, shape (N, R): CasADi has the columns of A one after another.
        self._slopes = np.zeros((self._point.size, self._rows.size))
        outputs = {0: self._rows, 1: self._slopes.ravel()}
        self._call = Buffered(function, {0: self._point}, outputs)

    def run(self, start: FloatArray) -> tuple[FloatArray, FloatArray, Status]:
        """Return the last point, shape (N,), no multipliers, and how the steps ended."""
        cpu, wall = time.process_time(), time.perf_counter()
        self._point[:] = finite_vector("start", start, self._point.size)
        ended, count = self._descend()
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        slope = 2 * float(np.abs(self._slopes @ self._rows).max())
        status = Status(ended, count, 0.0, slope, math.nan, cpu, wall)
        return self._point.copy(), np.zeros(0), status

    def _descend(self) -> tuple[str, int]:
        """Move the point; return how that ended, and the number of steps."""
        self._call.run()
        squares = float(self._rows @ self._rows)
        for count in range(self._most):
            if not math.isfinite(squares):
                return INVALID, count
            if squares <= _TOLERANCE**2:
                return SUCCESS, count
            lower = self._falls(squares)
            if lower is None:
                return STALLED, count
            squares = lower
        return SUCCESS if squares <= _TOLERANCE**2 else LIMIT, self._most

    def _falls(self, squares: float) -> float | None:
        """Make a step from a point with this sum of squares; return the sum there.

        It changes the point, r and A in place. None, and no step, if the sum does not fall.
        """
        system = self._slopes.T @ self._slopes
        system.ravel()[:: len(system) + 1] += _SHIFT / 2 * math.sqrt(squares) + _LEAST_SHIFT / 2
        _, solved, failed = self._solve(system, self._rows, lower=True, overwrite_a=True)
        if failed:
            return None
        before, step = self._point.copy(), self._slopes @ solved
        for halvings in range(_LENGTHS):
            self._point[:] = before - 0.5**halvings * step
            self._call.run()
            found = float(self._rows @ self._rows)
            if found < squares:
                return found
        self._point[:] = before
        self._call.run()
        return None
