"""Calls of a solver that is set up: from a start to a point, and how the solver ended."""

import threading
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Buffered

# MUMPS keeps global state: in one process it solves one problem at a time.
_ONE_AT_A_TIME = threading.Lock()


class Ended(NamedTuple):
    """How a solver ended.

    Attributes
    ----------
    return_status
        The solver's own word.
    iterations
        Number of iterations.
    history
        Statistics of each iteration by CasADi's names, such as ``inf_pr``; empty without any.
    success
        Whether the solver says that it converged.
    """

    return_status: str
    iterations: int
    history: Mapping[str, Any]
    success: bool


class Call(Protocol):
    """A solver that is set up for one problem.

    Attributes
    ----------
    needs_values
        Whether it runs for ever from a start at which a function of the problem is NaN. Such
        a start is then refused before the call.
    """

    needs_values: bool

    def __call__(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the solver's point and the multipliers of the constraints."""

    def ended(self) -> Ended:
        """Return how the last call ended."""


class CasadiCall:
    """Calls CasADi's solver on arrays of its own.

    Parameters
    ----------
    solver
        What `casadi.nlpsol` returned.
    bounds
        Lower and upper bounds of the variables and then of the constraints, shape (2, numbers).
    size
        Number of variables.
    """

    needs_values = False

    def __init__(self, solver: ca.Function, bounds: FloatArray, size: int) -> None:
        self._solver = solver
        self._memory = int(solver.checkout())  # by which statistics are asked for
        solver.release(self._memory)  # the buffer takes it
        (lbx, lbg), (ubx, ubg) = (np.split(side, [size]) for side in bounds)
        self._start, self._found = np.zeros(size), np.zeros(size)
        self._multipliers = np.zeros(bounds.shape[1] - size)
        arguments = {"x0": self._start, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
        results = {"x": self._found, "lam_g": self._multipliers}
        self._buffered = Buffered(
            solver,
            {solver.index_in(key): array for key, array in arguments.items()},
            {solver.index_out(key): array for key, array in results.items()},
        )

    def __call__(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the solver's point and the multipliers of the constraints.

        Raises
        ------
        KeyboardInterrupt
            If the user interrupted: CasADi stops the solver, and Python says only that. What
            another handler of signals raised is raised here, too.
        """
        with _ONE_AT_A_TIME:
            self._start[:] = start
            try:
                self._buffered.run()
            except SystemError as error:
                # What a handler of signals raised while Python was asked for them.
                if error.__cause__ is not None:
                    raise error.__cause__ from None
                raise
            return self._found.copy(), self._multipliers.copy()

    def ended(self) -> Ended:
        """Return how the solver ended; what `Ended` says."""
        stats: Mapping[str, Any] = self._solver.stats(self._memory)
        status, iterations = str(stats["return_status"]), int(stats["iter_count"])
        return Ended(status, iterations, stats.get("iterations", {}), bool(stats["success"]))
