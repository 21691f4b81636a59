"""Columns of a Jacobian as functions of variables without equations or bounds.

The joints of the library have angles, or entries held by equations. Here each column is a
formula of free vectors a, b in R³ (free columns: a in Rᵐ), with ω = b/|b| and a⊥ = a − (a·ω)ω::

    free                a/|a|                        times its norm
    free-mean           a                            J times a factor, for the mean of ‖j‖²
    unit revolute       (a⊥/|a⊥|; ω)
    lever, mean budget  (a⊥; ω)                      a⊥ times a factor, for the mean of |v|²
    lever, each         (2ℓa⊥/(1 + |a⊥|²) + cω; ω)   lever arm ≤ ℓ, equal at |a⊥| = 1
    prismatic           (a/|a|; 0)                   times its speed

Here ℓ is the length of a lever arm, and c the pitch. A mean square is exactly the one that the
joints allow, as no singular value falls when columns (or all their upper rows) are scaled up:
JJᵀ grows. The condition number of free columns does not depend on the factor. The upper and the
lower three rows of an isotropic J have equal traces, r for r revolute joints. Prismatic columns
take a part of the upper one, so the lever arms get less.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import Joint
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError


@dataclass(frozen=True, eq=False)
class Columns:
    """J and its slopes as functions of x, (size,)."""

    joints: tuple[Joint, ...]
    size: int
    shape: tuple[int, int]
    function: ca.Function  # x to J, (m, n)
    slopes: ca.Function  # x to J, and ∂J/∂x, (m·n, size), J's entries column after column
    pull: ca.Function  # x and weights W (m, n) to the gradient of ⟨W, J⟩

    @classmethod
    def of(cls, arm: Arm, isotropic: bool = False) -> "Columns":
        """Return the columns of an arm; InputError for joints without a formula.

        If J has to be isotropic the lever arms get the mean square that this leaves them. That
        is known beside prismatic joints only.
        """
        sizes = [_size(joint) for joint in arm.joints]
        x = ca.SX.sym("x", sum(sizes))
        parts = ca.vertsplit(x, np.cumsum([0, *sizes]).tolist())
        jacobian = _scaled(arm.joints, parts, isotropic)
        weights = ca.SX.sym("W", *arm.shape)
        entries = ca.vec(jacobian)
        pulled = ca.jtimes(entries, x, ca.vec(weights), True)
        return cls(
            arm.joints,
            x.numel(),
            arm.shape,
            ca.Function("jacobian", [x], [jacobian]),
            ca.Function("slopes", [x], [jacobian, ca.densify(ca.jacobian(entries, x))]),
            ca.Function("pull", [x, weights], [pulled]),
        )

    def jacobian(self, point: FloatArray) -> FloatArray:
        """Return J, shape (m, n)."""
        return np.array(self.function(point), dtype=float)

    def with_slopes(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return J, (m, n), and ∂J/∂x, (m·n, size)."""
        jacobian, slopes = self.slopes(point)
        return np.array(jacobian, dtype=float), np.array(slopes, dtype=float)

    def pulled(self, point: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the gradient of ⟨weights, J⟩ by x, shape (size,); weights (m, n)."""
        return np.array(self.pull(point, weights), dtype=float).ravel()

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw x: standard normal, so that directions are uniform."""
        return rng.standard_normal(self.size)

    def parts(self, point: FloatArray) -> list[FloatArray]:
        """Return the variables of each joint, views of x."""
        ends = np.cumsum([_size(joint) for joint in self.joints])
        return np.split(point, ends[:-1])

    def point(self, jacobian: FloatArray) -> FloatArray:
        """Return x, (size,), of which J is this Jacobian of the arm, (m, n)."""
        parts = [
            _variables(joint, column)
            for joint, column in zip(self.joints, jacobian.T, strict=True)
        ]
        return np.concatenate(parts)


def _size(joint: Joint) -> int:
    """Return the number of a joint's variables."""
    match joint:
        case FreeColumn():
            return joint.dimension
        case Prismatic():
            return 3
        case UnitRevolute() | LeverRevolute():
            return 6
    raise InputError("joint", repr(joint), "a joint of the library")


def _scaled(joints: Sequence[Joint], parts: Sequence[ca.SX], isotropic: bool) -> ca.SX:
    """Return J, with the factors of joints that share a mean square."""
    columns = [_column(joint, part) for joint, part in zip(joints, parts, strict=True)]
    for kind in dict.fromkeys(joint for joint in joints if joint.budget == "mean"):
        if not isinstance(kind, FreeColumn | LeverRevolute):
            continue
        places = [place for place, joint in enumerate(joints) if joint == kind]
        rows = columns[places[0]].numel() if isinstance(kind, FreeColumn) else 3
        square = sum(ca.sumsqr(columns[place][:rows]) for place in places) / len(places)
        allowed = kind.extent_bound**2
        if isotropic and isinstance(kind, LeverRevolute):
            allowed = min(allowed, _left_for_levers(joints) / len(places))
        factor = ca.sqrt(allowed / square)
        for place in places:
            upper, lower = columns[place][:rows], columns[place][rows:]
            columns[place] = ca.vertcat(factor * upper, lower)
    return ca.horzcat(*columns)


def _left_for_levers(joints: Sequence[Joint]) -> float:
    """Return Σ|v|² of the lever arms that share a budget, in an isotropic J.

    It is the trace of the lower rows, one for each revolute joint, less the prismatic columns.
    """
    levers = [joint for joint in joints if not isinstance(joint, Prismatic)]
    left = len(levers) - sum(j.speed**2 for j in joints if isinstance(j, Prismatic))
    if len(set(levers)) > 1 or left <= 0:
        allowed = "lever arms of one kind and fewer, or slower, prismatic joints, if isotropic"
        raise InputError("joints", f"of {len(set(joints))} kinds", allowed)
    return left


def _column(joint: Joint, part: ca.SX) -> ca.SX:
    """Return a joint's column of its variables, before factors."""
    match joint:
        case FreeColumn():
            return joint.norm * _unit(part) if joint.budget == "each" else part
        case Prismatic():
            return ca.vertcat(joint.speed * _unit(part), ca.SX.zeros(3))
    axis = _unit(part[3:])
    lever = part[:3] - ca.dot(part[:3], axis) * axis
    if isinstance(joint, LeverRevolute):
        if joint.budget == "mean" and joint.pitch:
            raise InputError("joint", repr(joint), "no pitch where lever arms share a budget")
        if joint.budget == "each":
            lever = 2 * joint.length / (1 + ca.sumsqr(lever)) * lever + joint.pitch * axis
        return ca.vertcat(lever, axis)
    return ca.vertcat(_unit(lever), axis)


def _variables(joint: Joint, column: FloatArray) -> FloatArray:
    """Return the variables of a joint's column, (m,)."""
    if isinstance(joint, Prismatic):
        return column[:3]
    if not isinstance(joint, LeverRevolute) or joint.budget == "mean":
        return column
    # The shorter of two a with |v| = 2ℓ|a|/(1 + |a|²): a = v/(ℓ + √(ℓ² − |v|²)).
    lever = column[:3] - joint.pitch * column[3:]
    rest = max(joint.length**2 - float(lever @ lever), 0.0)
    inner = lever / (joint.length + np.sqrt(rest))
    return np.concatenate([inner, column[3:]])


def _unit(vector: ca.SX) -> ca.SX:
    return vector / ca.norm_2(vector)
