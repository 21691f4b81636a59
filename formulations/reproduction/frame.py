"""fᵀf of one Jacobian in the best frame: the paper's sum of squares depends on the frame.

::

    minimise   fᵀf of diag(R, R) P J     over rotations R and phases P
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from formulations.joints.kinds import UnitRevolute
from formulations.reproduction.searches import search
from nlp.arrays import FloatArray
from nlp.problem import Problem


def least_sum_of_squares(jacobian: FloatArray, starts: int = 5, seed: int = 0) -> float:
    """Return the least fᵀf over frames and phases; J has shape (6, n)."""
    problem = _build(jacobian)

    def sample(rng: np.random.Generator) -> FloatArray:
        return rng.uniform(-np.pi, np.pi, problem.size)

    found = search(lambda: problem, sample, starts=starts, seed=seed)
    return min(solution.objective for solution in found)


def _build(jacobian: FloatArray) -> Problem:
    angles = ca.SX.sym("a", 4)
    # The triple (v, ω, v × ω) of a unit revolute joint is any rotation matrix.
    column = UnitRevolute().column(angles[:3])
    velocity, axis = column[:3], column[3:]
    rotation = ca.horzcat(velocity, axis, ca.cross(velocity, axis))
    c, s = ca.cos(angles[3]), ca.sin(angles[3])
    v, w = ca.DM(jacobian[:3]), ca.DM(jacobian[3:])
    turned = ca.vertcat(rotation @ (c * v - s * w), rotation @ (s * v + c * w))
    gram = turned @ turned.T
    deviation = gram - ca.trace(gram) / 6 * ca.SX.eye(6)
    squares = [deviation[i, j] ** 2 for i in range(6) for j in range(i, 6)]
    return Problem("frame", angles, sum(squares[1:], squares[0]))
