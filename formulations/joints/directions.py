"""Directions in space: the frames of eq. (21), their angles and how they are drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np

from formulations.joints.joint import Budget
from nlp.arrays import FloatArray


def symbolic_frame(alpha: ca.SX, beta: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Right-handed frame (e₁, e₂, ω): v = cosγ e₁ + sinγ e₂ in eq. (21)."""
    sin_a, cos_a, sin_b, cos_b = ca.sin(alpha), ca.cos(alpha), ca.sin(beta), ca.cos(beta)
    first = ca.vertcat(cos_a * sin_b, sin_a * sin_b, -cos_b)
    second = ca.vertcat(sin_a, -cos_a, 0)
    return first, second, ca.vertcat(cos_a * cos_b, sin_a * cos_b, sin_b)


def numeric_frame(
    alpha: FloatArray, beta: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows of the frames of `symbolic_frame` at numeric angles, each of shape (count, 3)."""
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    first = np.column_stack([cos_a * sin_b, sin_a * sin_b, -cos_b])
    second = np.column_stack([sin_a, -cos_a, np.zeros_like(alpha)])
    return first, second, np.column_stack([cos_a * cos_b, sin_a * cos_b, sin_b])


def uniform_direction(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """Angles (α, β) of `count` directions, uniform on the sphere; radians."""
    alpha = rng.uniform(-np.pi, np.pi, count)
    return alpha, np.arcsin(rng.uniform(-1.0, 1.0, count))


def in_ball(rng: np.random.Generator, count: int, size: int, budget: Budget) -> FloatArray:
    """Uniform points of the unit ball: one in each joint's plane, or one of them all."""
    points = rng.standard_normal((count, size))
    if budget == "each":
        radii = rng.uniform(size=(count, 1)) ** (1 / size)
        return np.asarray(radii * points / np.linalg.norm(points, axis=1, keepdims=True))
    radius = np.sqrt(count) * rng.uniform() ** (1 / (count * size))
    return np.asarray(radius * points / np.linalg.norm(points))


def direction_angles(direction: Sequence[float] | FloatArray) -> tuple[float, float]:
    """Angles (α, β) of a direction: ω = (cosα cosβ, sinα cosβ, sinβ)."""
    x, y, z = direction
    return math.atan2(y, x), math.atan2(z, math.hypot(x, y))
