"""An arm: joints side by side, of any kinds, and its Jacobian in terms of their parameters.

The Jacobian J has shape (m, n): m task dimensions, a column for each of n joints. The variables
of an arm are the parameters of its joints (`Joint.parameters`), joint after joint, `size`
numbers. What a joint's *extent* is, and what bounds it, is said by its kind: the lever arm's
length of a revolute joint, the norm of a free column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from itertools import groupby, pairwise
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.joints.joint import TOLERANCE, ArmModel, Joint, NotInModelError
from lockedjoint.nlp.arrays import FloatArray, as_floats, finite_vector, whole_number
from lockedjoint.nlp.errors import InputError, entries_of, of_kind
from lockedjoint.nlp.problem import Constraint, Evaluation

# Largest number of joints of an arm of one kind. What a formulation is stated for is less, see
# `lockedjoint.formulations.joints.models.arm`.
_MOST_JOINTS = 10_000


@dataclass(frozen=True, repr=False)
class Arm(ArmModel):
    """A manipulator: one kind of joint for each column of its Jacobian.

    Parameters
    ----------
    joints
        The kind of each joint, in order; kinds may be mixed but share one task dimension.

    Raises
    ------
    InputError
        If there are not more joints than task dimensions, or dimensions differ.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> arm = lj.Arm((lj.UnitRevolute(),) * 6 + (lj.Prismatic(),))
    >>> arm.shape
    (6, 7)
    """

    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        joints = tuple(entries_of("joints", self.joints, "a row of joints"))
        object.__setattr__(self, "joints", joints)
        for joint in self.joints:
            of_kind("joint", joint, Joint, "a Joint, such as UnitRevolute()")
        dimensions = sorted({joint.dimension for joint in self.joints})
        if len(dimensions) != 1:
            raise InputError("task dimensions of the joints", dimensions, "one and the same")
        if len(self.joints) <= dimensions[0]:
            allowed = f"more joints than task dimensions, here at least {dimensions[0] + 1}"
            raise InputError("joints", len(self.joints), allowed)

    @classmethod
    def of(cls, joint: Joint, count: int) -> Arm:
        """Return an arm of `count` joints of one kind."""
        return cls((joint,) * whole_number("joints", count, 1, _MOST_JOINTS))

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""
        return self.joints[0].dimension, len(self.joints)

    @property
    def largest_trace(self) -> float:
        """Largest ‖J‖_F² = tr JJᵀ that the joints allow."""
        return float(sum(joint.largest_norm_squared for joint in self.joints))

    @property
    def fixed_trace(self) -> float | None:
        """‖J‖_F² where every Jacobian of the arm has the same; None otherwise."""
        fixed = all(joint.exact or joint.extent_bound == np.inf for joint in self.joints)
        return self.largest_trace if fixed else None

    @property
    def description(self) -> str:
        """Return the number and the kinds of the joints."""
        names = ", ".join(dict.fromkeys(type(joint).__name__ for joint in self.joints))
        return f"{len(self.joints)} joints ({names})"

    def to_dict(self) -> dict[str, Any]:
        """Return the joints in order, each with its kind and settings, as plain values."""
        rows, columns = self.shape
        return {
            "task_dimension": rows,
            "joints": [{"kind": type(joint).__name__, **vars(joint)} for joint in self.joints],
            "number_of_joints": columns,
            "largest_trace": self.largest_trace,
        }

    def __repr__(self) -> str:
        """Say the joints in order, equal neighbours as one, and the task dimensions."""
        runs = [(kind, len(list(same))) for kind, same in groupby(self.joints)]
        listed = ", ".join(f"{count} × {kind!r}" for kind, count in runs)
        return f"<Arm: {listed}, m = {self.shape[0]}>"

    def _repr_html_(self) -> str:
        """Show the same in a notebook."""
        return f"<p>{escape(repr(self))}</p>"

    def symbols(self) -> ca.SX:
        """Symbols of all joints' parameters, joint after joint, shape (size, 1)."""
        named = [f"{name}{i}" for i, j in enumerate(self.joints, 1) for name in j.parameters]
        return ca.vertcat(*map(ca.SX.sym, named))

    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian, shape (m, n)."""
        parts = self._split(variables)
        return ca.horzcat(*(j.column(p) for j, p in zip(self.joints, parts, strict=True)))

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:
        """Return the joints' own equations, and bounds on their extents.

        Bounds are one row per joint, or one row on the mean square.
        """
        parts = list(zip(self.joints, self._split(variables), strict=True))
        equations = ca.vertcat(*(joint.equations(part) for joint, part in parts))
        constraints = []
        if equations.numel():
            constraints.append(Constraint("joint equations", equations, 0.0, 0.0))
        for kind in dict.fromkeys(self.joints):
            squares = [kind.extent_squared(part) for joint, part in parts if joint == kind]
            limited = [square for square in squares if square is not None]
            if limited:
                constraints.append(_extent_constraint(kind, limited))
        return tuple(constraints)

    @property
    def size(self) -> int:
        """Number of variables."""
        return sum(len(joint.parameters) for joint in self.joints)

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw random variables; uniform where the joints' manifold has a uniform measure."""
        drawn: list[FloatArray] = [np.zeros(0)] * len(self.joints)
        for kind in dict.fromkeys(self.joints):
            places = [i for i, joint in enumerate(self.joints) if joint == kind]
            for place, row in zip(places, kind.sample(rng, len(places)), strict=True):
                drawn[place] = row
        return np.concatenate(drawn)

    def variables(self, jacobian: npt.ArrayLike) -> FloatArray:
        """Return variables that give this Jacobian: the inverse of `jacobian`.

        Raises
        ------
        NotInModelError
            If a column is not one that its joint can contribute, or a shared bound is broken.
        InputError
            If the array has another shape or is not finite.
        """
        matrix = as_floats("jacobian", jacobian)
        if matrix.shape != self.shape:
            raise InputError("jacobian", f"of shape {matrix.shape}", f"shape {self.shape}")
        finite_vector("jacobian", matrix.ravel(), matrix.size)
        rows = [joint.invert(matrix[:, i]) for i, joint in enumerate(self.joints)]
        point = np.concatenate(rows)
        self._check_extents(point)
        return point

    def admits(self, jacobian: FloatArray, variables: FloatArray | None = None) -> bool:  # noqa: ARG002
        """Whether each column is one that its joint can contribute, and shared bounds hold."""
        try:
            self.variables(jacobian)
        except InputError:  # also for NaN and infinity
            return False
        return True

    def _check_extents(self, point: FloatArray) -> None:
        """Raise NotInModelError if variables break the joints' own constraints."""
        constraints, evaluation = _own_constraints(self)
        for constraint, column in zip(constraints, evaluation(point), strict=True):
            value = column.ravel()
            low, high = np.asarray(constraint.lower), np.asarray(constraint.upper)
            slack = TOLERANCE * (1 + np.abs(high))
            if np.any(value < low - slack) or np.any(value > high + slack):
                allowed = f"within [{low.min():g}, {high.max():g}]"
                raise NotInModelError(constraint.name, value.tolist(), allowed)

    def _split(self, variables: ca.SX) -> Sequence[ca.SX]:
        """Return the parameters of each joint, a column each."""
        if variables.numel() != self.size:
            raise InputError("variables", f"of shape {variables.shape}", f"{self.size} rows")
        ends = np.cumsum([0, *(len(joint.parameters) for joint in self.joints)])
        return [variables[int(a) : int(b)] for a, b in pairwise(ends)]


def _extent_constraint(kind: Joint, squares: Sequence[ca.SX]) -> Constraint:
    """Return the bound on the squared extents of all joints of a kind, each or in the mean."""
    name = f"extent of {type(kind).__name__}"
    high = kind.extent_bound**2
    low = high if kind.exact else -np.inf
    stacked = ca.vertcat(*squares)
    if kind.budget == "mean":
        return Constraint(f"mean squared {name}", ca.sum1(stacked) / len(squares), low, high)
    return Constraint(f"squared {name}", stacked, low, high)


@lru_cache(maxsize=64)
def _own_constraints(arm: Arm) -> tuple[tuple[Constraint, ...], Evaluation]:
    """Return the joints' own constraints, and their expressions ready to be evaluated."""
    symbols = arm.symbols()
    constraints = arm.constraints(symbols)
    return constraints, Evaluation(symbols, [one.expression for one in constraints])
