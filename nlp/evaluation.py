"""Expressions evaluated at numbers, with as little around the arithmetic as there can be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from nlp.arrays import FloatArray


class Evaluation:
    """Functions of one point, evaluated together.

    CasADi's usual call turns arrays into its own matrices and back, which takes several times
    as long as small functions do. Here they are read from one array and written to others.

    Parameters
    ----------
    variables
        Column of symbols.
    expressions
        What to evaluate.
    """

    def __init__(self, variables: ca.SX, expressions: Sequence[ca.SX]) -> None:
        full = [ca.densify(ca.SX(expression)) for expression in expressions]
        self._function = ca.Function("evaluation", [variables], full)
        buffer: Any
        buffer, self._run = self._function.buffer()
        self._point = np.zeros(variables.numel())
        self._columns = [np.zeros(expression.shape[::-1]) for expression in full]
        if self._point.size:
            buffer.set_arg(0, self._point.data)
        self._buffer = buffer  # which frees itself with its last reference
        for position, column in enumerate(self._columns):
            if column.size:
                buffer.set_res(position, column.ravel().data)

    def __call__(self, point: FloatArray) -> list[FloatArray]:
        """Return the value of each expression at a point, as arrays of two dimensions."""
        self._point[:] = point
        self._run()
        return [column.T.copy() for column in self._columns]
