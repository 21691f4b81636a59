"""A CasADi function at many points, in one call."""

from __future__ import annotations

import math
import threading

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Buffered

# The least number of points of a call: fewer would need another map and gain nothing.
_LEAST = 8


class AtManyPoints:
    """Evaluates a function at B points.

    The function is mapped over powers of two: a batch is padded with its first point, so that
    few maps are made. Arrays are the same for all calls.

    Parameters
    ----------
    function
        Of dense columns, to dense results.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        # What `_mapped` made, by number of points.
        self._made: dict[int, tuple[Buffered, list[FloatArray], list[FloatArray]]] = {}
        self._lock = threading.Lock()  # the arrays are one thread's at a time

    def __call__(self, *points: FloatArray) -> list[FloatArray]:
        """Return each result, (B, rows, columns), of columns, shape (B, rows) each."""
        count = len(points[0])
        size = max(_LEAST, 1 << math.ceil(math.log2(max(count, 1))))
        with self._lock:
            if size not in self._made:
                self._made[size] = self._mapped(size)
            mapped, given, results = self._made[size]
            for array, values in zip(given, points, strict=True):
                array[:count] = values
                array[count:] = values[0]
            mapped.run()
            # CasADi has columns one after the other.
            return [array[:count].transpose(0, 2, 1).copy() for array in results]

    def _mapped(self, size: int) -> tuple[Buffered, list[FloatArray], list[FloatArray]]:
        """Return the call for `size` points, its arguments, and its results, as arrays.

        An argument has shape (size, rows), a result (size, columns, rows).
        """
        function, mapped = self._function, self._function.map(size)
        given = [np.zeros((size, function.numel_in(k))) for k in range(function.n_in())]
        shapes = [function.size_out(k)[::-1] for k in range(function.n_out())]
        results = [np.zeros((size, *shape)) for shape in shapes]
        flat = [dict(enumerate(one.reshape(-1) for one in side)) for side in (given, results)]
        return Buffered(mapped, *flat), given, results
