"""Families of isotropic Jacobians of unit revolute joints (Section 4, after eq. 46).

Near a solution of JJᵀ = (n/3)I the others form a manifold in the space of the 3n angles. The
symmetries (rotations of the frame, common phase) move along it without changing the
manipulator; what is left are truly different Jacobians, followed here by a
predictor–corrector method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from formulations.appendix import residuals
from formulations.arm import Arm
from nlp.arrays import FloatArray, finite_vector, whole_number
from nlp.errors import InputError

# Singular values of the equations' derivative below this count as zero.
_RANK_TOLERANCE = 1e-6
_RESIDUAL_TOLERANCE = 1e-13
_CORRECTIONS = 50


@dataclass(frozen=True)
class LocalDimension:
    """Dimensions of the solution set around a solution.

    Attributes
    ----------
    angles
        Number of joint angles, 3n.
    equations
        Rank of the derivative of the 21 equations.
    symmetries
        Rank of the directions in which only frame and phase change.
    """

    angles: int
    equations: int
    symmetries: int

    @property
    def family(self) -> int:
        """Dimension of the family of different Jacobians."""
        return self.angles - self.equations - self.symmetries


def local_dimension(arm: Arm, angles: npt.ArrayLike) -> LocalDimension:
    """Return the dimensions around a solution; angles in radians, shape (3n,)."""
    point = finite_vector("angles", angles, arm.size)
    _, derivative = _equations(arm, point)
    ranks = [
        int(np.linalg.matrix_rank(matrix, tol=_RANK_TOLERANCE))
        for matrix in (derivative, symmetry_directions(arm, point))
    ]
    return LocalDimension(arm.size, *ranks)


def symmetry_directions(arm: Arm, angles: npt.ArrayLike) -> FloatArray:
    """Angle velocities of the three rotations of the frame and of the phase, shape (4, 3n)."""
    point = finite_vector("angles", angles, arm.size)
    jacobian, derivative = (np.array(part) for part in _jacobian_function(arm)(point))
    velocity, axis = jacobian[:3], jacobian[3:]
    motions = [
        np.vstack([np.cross(unit, part, axisb=0).T for part in (velocity, axis)])
        for unit in np.eye(3)
    ]
    motions.append(np.vstack([-axis, velocity]))
    # CasADi stacks matrices column by column.
    targets = np.column_stack([motion.ravel(order="F") for motion in motions])
    return np.asarray(np.linalg.lstsq(derivative, targets, rcond=None)[0].T)


def solve_near(arm: Arm, angles: npt.ArrayLike) -> FloatArray:
    """Return the isotropic solution that Gauss–Newton steps of least norm lead to.

    Raises
    ------
    InputError
        If they lead to none.
    """
    point = finite_vector("angles", angles, arm.size)
    for _ in range(_CORRECTIONS):
        values, derivative = _equations(arm, point)
        if np.max(np.abs(values)) <= _RESIDUAL_TOLERANCE:
            return point
        point = point - np.linalg.lstsq(derivative, values, rcond=_RANK_TOLERANCE)[0]
    if np.max(np.abs(_equations(arm, point)[0])) <= 10 * _RESIDUAL_TOLERANCE:
        return point
    raise InputError("angles", "far from any solution", "angles near an isotropic Jacobian")


def trace_family(
    arm: Arm, angles: npt.ArrayLike, steps: int = 20, length: float = 0.05
) -> list[FloatArray]:
    """Follow a curve of different solutions.

    Parameters
    ----------
    arm
        Unit revolute joints.
    angles
        A solution to start near, in radians, shape (3n,).
    steps
        Number of further solutions, at least 1.
    length
        Norm of each predicted step in the space of angles, in radians.

    Returns
    -------
    list of numpy.ndarray
        ``steps + 1`` solutions, each of shape (3n,).

    Raises
    ------
    InputError
        If the solution is isolated, or the curve is lost because `length` is too large.
    """
    whole_number("steps", steps, 1)
    points = [solve_near(arm, angles)]
    if local_dimension(arm, points[0]).family < 1:
        raise InputError("angles", "an isolated solution", "a member of a family")
    direction = np.ones(arm.size)
    for _ in range(steps):
        direction = _along_family(arm, points[-1], direction)
        points.append(solve_near(arm, points[-1] + length * direction))
    return points


def _along_family(arm: Arm, point: FloatArray, direction: FloatArray) -> FloatArray:
    """Unit vector nearest to `direction` that changes neither equations nor frame and phase."""
    _, derivative = _equations(arm, point)
    fixed = np.vstack([derivative, symmetry_directions(arm, point)])
    _, values, vectors = np.linalg.svd(fixed)
    free = vectors[int(np.sum(values > _RANK_TOLERANCE)) :]
    tangent = free.T @ (free @ direction)
    return np.asarray(tangent / np.linalg.norm(tangent))


def _equations(arm: Arm, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    values, derivative = _equations_function(arm)(point)
    return np.array(values).ravel(), np.array(derivative)


@lru_cache(maxsize=8)
def _equations_function(arm: Arm) -> ca.Function:
    angles = arm.symbols()
    equations = residuals(arm, angles)
    return ca.Function("equations", [angles], [equations, ca.jacobian(equations, angles)])


@lru_cache(maxsize=8)
def _jacobian_function(arm: Arm) -> ca.Function:
    angles = arm.symbols()
    matrix = arm.matrix(angles)
    return ca.Function("jacobian", [angles], [matrix, ca.jacobian(ca.vec(matrix), angles)])
