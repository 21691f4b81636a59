"""Pymanopt on the residual: trust regions on SO(3)ⁿ, analytic gradient and Hessian."""

import numpy as np

from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from results.benchmark import unit_revolute as hand
from results.benchmark.measurement import Solve


def prepare(arm: Arm) -> Solve:
    """Return what solves a start."""
    import pymanopt
    from pymanopt.manifolds import SpecialOrthogonalGroup
    from pymanopt.optimizers import TrustRegions

    n = arm.shape[1]
    manifold = SpecialOrthogonalGroup(3, k=n)

    def columns(points: FloatArray) -> FloatArray:
        return np.vstack([points[:, :, 0].T, points[:, :, 1].T])

    def lifted(slope: FloatArray) -> FloatArray:
        return np.stack([slope[:3].T, slope[3:].T, np.zeros((n, 3))], axis=2)

    def gap(matrix: FloatArray) -> FloatArray:
        return np.asarray(matrix @ matrix.T - n / 3 * np.eye(6))

    def cost(points: FloatArray) -> float:
        return float(0.5 * np.sum(gap(columns(points)) ** 2))

    def gradient(points: FloatArray) -> FloatArray:
        matrix = columns(points)
        return lifted(2 * gap(matrix) @ matrix)

    def hessian(points: FloatArray, vector: FloatArray) -> FloatArray:
        matrix, moved = columns(points), columns(vector)
        change = moved @ matrix.T
        return lifted(2 * (gap(matrix) @ moved + (change + change.T) @ matrix))

    on = pymanopt.function.numpy(manifold)
    derivatives = {"euclidean_gradient": on(gradient), "euclidean_hessian": on(hessian)}
    problem = pymanopt.Problem(manifold, on(cost), **derivatives)
    optimizer = TrustRegions(verbosity=0)

    def solve(start: FloatArray) -> FloatArray:
        matrix = hand.jacobian(start)
        v, w = matrix[:3].T, matrix[3:].T
        point = np.stack([v, w, np.cross(v, w)], axis=2)
        return columns(optimizer.run(problem, initial_point=point).point)

    return solve
