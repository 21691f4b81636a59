"""Families of isotropic Jacobians of unit revolute joints (Section 4, after eq. 46).

Near a solution of JJᵀ = (n/3)I the others form a manifold in the space of the 3n angles. The
symmetries (rotations of the frame, common phase) move along it without changing the
manipulator; what is left are truly different Jacobians, followed here by a
predictor–corrector method.

Of the 21 equations 18 are independent as functions, which leaves 24 − 4 − 18 = 2 dimensions
for 8R. That is a lower bound: on most of the solutions that random starts find, (47) among
them, the derivatives of the 18 are dependent and the family has three dimensions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from formulations.isotropy_equations import appendix_residuals
from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Singular values of the equations' derivative below this count as zero.
_RANK_TOLERANCE = 1e-6
# Corrections first leave out directions that the equations hardly see: where the rank is
# about to drop, a full step goes far along them for nothing.
_CUTOFFS = (3e-3, 1e-6, 1e-8)
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


def local_dimension(arm: Arm, angles: FloatArray) -> LocalDimension:
    """Return the dimensions around a solution; angles in radians, shape (3n,)."""
    matrices = (_equations(arm, angles)[1], symmetry_directions(arm, angles))
    ranks = (int(np.linalg.matrix_rank(matrix, tol=_RANK_TOLERANCE)) for matrix in matrices)
    return LocalDimension(arm.size, *ranks)


def least_slope(arm: Arm, angles: FloatArray) -> float:
    """Smallest nonzero singular value of the equations' derivative.

    Angles whose equations are off by r can be r/slope from a solution, to first order.
    """
    values = np.linalg.svd(_equations(arm, angles)[1], compute_uv=False)
    return float(np.min(values[values > _RANK_TOLERANCE]))


def fills_tangent_space(arm: Arm, angles: FloatArray, step: float = 1e-3) -> bool:
    """Whether solutions lie in every direction that `local_dimension` counts.

    A rank alone bounds the dimension of the family from above. Here a step of length
    `step`, in radians, goes both ways along each tangent direction; if solutions fill the
    tangent space, a correction of the order of its square reaches one, of the same rank.
    """
    expected = local_dimension(arm, angles)
    for direction in _family_directions(arm, angles):
        for sign in (1.0, -1.0):
            predicted = angles + sign * step * direction
            try:
                solution = solve_near(arm, predicted)
            except InputError:
                return False
            far = np.linalg.norm(solution - predicted) > 10 * step**2
            if far or local_dimension(arm, solution) != expected:
                return False
    return True


def symmetry_directions(arm: Arm, angles: FloatArray) -> FloatArray:
    """Angle velocities of the three rotations of the frame and of the phase, shape (4, 3n)."""
    evaluated = _with_derivative(arm, Arm.matrix)(angles)
    jacobian, derivative = map(np.array, evaluated)
    velocity, axis = jacobian[:3], jacobian[3:]
    motions = [
        np.vstack([np.cross(unit, part, axisb=0).T for part in (velocity, axis)])
        for unit in np.eye(3)
    ]
    motions.append(np.vstack([-axis, velocity]))
    # CasADi stacks matrices column by column.
    targets = np.column_stack([motion.ravel(order="F") for motion in motions])
    return np.asarray(np.linalg.lstsq(derivative, targets, rcond=None)[0].T)


def solve_near(arm: Arm, angles: FloatArray) -> FloatArray:
    """Return the isotropic solution nearby that Gauss–Newton steps of least norm lead to.

    Raises
    ------
    InputError
        If they lead to none.
    """
    for cutoff in _CUTOFFS:
        point = angles
        for _ in range(_CORRECTIONS):
            values, derivative = _equations(arm, point)
            if np.max(np.abs(values)) <= _RESIDUAL_TOLERANCE:
                return point
            point = point - np.linalg.lstsq(derivative, values, rcond=cutoff)[0]
    raise InputError("angles", "far from any solution", "angles near an isotropic Jacobian")


def trace_family(
    arm: Arm, angles: FloatArray, steps: int = 20, length: float = 0.05
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
    points = [solve_near(arm, angles)]
    if local_dimension(arm, points[0]).family < 1:
        raise InputError("angles", "an isolated solution", "a member of a family")
    direction = np.ones(arm.size)
    for _ in range(steps):
        free = _family_directions(arm, points[-1])
        tangent = free.T @ (free @ direction)
        direction = tangent / np.linalg.norm(tangent)
        points.append(solve_near(arm, points[-1] + length * direction))
    return points


def _family_directions(arm: Arm, point: FloatArray) -> FloatArray:
    """Orthonormal rows that change neither the equations nor frame and phase."""
    _, derivative = _equations(arm, point)
    fixed = np.vstack([derivative, symmetry_directions(arm, point)])
    _, values, vectors = np.linalg.svd(fixed)
    return np.asarray(vectors[int(np.sum(values > _RANK_TOLERANCE)) :])


def _equations(arm: Arm, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    values, derivative = _with_derivative(arm, appendix_residuals)(angles)
    return np.array(values).ravel(), np.array(derivative)


@lru_cache(maxsize=16)
def _with_derivative(arm: Arm, state: Callable[[Arm, ca.SX], ca.SX]) -> ca.Function:
    """Numeric function of the angles: an expression, and its derivative."""
    angles = arm.symbols()
    expression = state(arm, angles)
    derivative = ca.jacobian(ca.vec(expression), angles)
    return ca.Function("with_derivative", [angles], [expression, derivative])
