"""An arm: joints side by side, of any kinds, or such that a map carries the arm into itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from itertools import combinations, groupby, pairwise
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.joints.joint import TOLERANCE, ColumnModel, Joint, NotInModelError
from lockedjoint.formulations.joints.kinds import FreeColumn, UnitRevolute
from lockedjoint.nlp.arrays import FloatArray, as_floats, finite_vector, whole_number
from lockedjoint.nlp.errors import InputError, entries_of, of_kind
from lockedjoint.nlp.problem import Constraint, Evaluation

# What can be stated is less, see `lockedjoint.formulations.joints.models.arm`.
_MOST_JOINTS = 10_000


@dataclass(frozen=True, repr=False)
class Arm(ColumnModel):
    """A manipulator as a row of joint kinds, one per column of its Jacobian.

    Parameters
    ----------
    joints
        The kind of each joint, in order; kinds may be mixed but share one task dimension.

    Raises
    ------
    InputError
        If there are not more joints than task dimensions, or dimensions differ.
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
        of_kind("rng", rng, np.random.Generator, "a NumPy Generator")
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
        constraints, evaluation = _own_constraints(self)
        for constraint, column in zip(constraints, evaluation(point), strict=True):
            value = column.ravel()
            low, high = np.asarray(constraint.lower), np.asarray(constraint.upper)
            slack = TOLERANCE * (1 + np.abs(high))
            if np.any(value < low - slack) or np.any(value > high + slack):
                allowed = f"within [{low.min():g}, {high.max():g}]"
                raise NotInModelError(constraint.name, value.tolist(), allowed)

    def _split(self, variables: ca.SX) -> Sequence[ca.SX]:
        of_kind("variables", variables, (ca.SX, ca.MX, ca.DM), "a column of CasADi symbols")
        if variables.numel() != self.size:
            raise InputError("variables", f"of shape {variables.shape}", f"{self.size} rows")
        ends = np.cumsum([0, *(len(joint.parameters) for joint in self.joints)])
        return [variables[int(a) : int(b)] for a, b in pairwise(ends)]


def _extent_constraint(kind: Joint, squares: Sequence[ca.SX]) -> Constraint:
    name = f"extent of {type(kind).__name__}"
    high = kind.extent_bound**2
    low = high if kind.exact else -np.inf
    stacked = ca.vertcat(*squares)
    if kind.budget == "mean":
        return Constraint(f"mean squared {name}", ca.sum1(stacked) / len(squares), low, high)
    return Constraint(f"squared {name}", stacked, low, high)


@lru_cache(maxsize=64)
def _own_constraints(arm: Arm) -> tuple[tuple[Constraint, ...], Evaluation]:
    symbols = arm.symbols()
    constraints = arm.constraints(symbols)
    return constraints, Evaluation(symbols, [one.expression for one in constraints])


@dataclass(frozen=True)
class SymmetricArm(ColumnModel):
    """Columns in orbits c, Gc, …, Gᵖ⁻¹c of a map G with Gᵖ = ±1, of joints of one kind.

    σ without a set of columns is that without the set that G makes of it. The columns that no
    whole orbit is left for, n mod p, are free of G.

    Parameters
    ----------
    arm
        n joints of one kind.
    symmetry
        Rows of G, an orthogonal matrix that maps columns of the kind to such columns.
    order
        p, the least power of G that is 1 or −1.
    """

    arm: Arm
    symmetry: tuple[tuple[float, ...], ...]
    order: int

    @classmethod
    def drawn(cls, arm: Arm, rng: np.random.Generator) -> SymmetricArm:
        """Draw G at random; half of the time of a low order, as most good optima have.

        Raises
        ------
        InputError
            If the joints are not of one kind, free columns or unit revolute.
        """
        joint, joints = arm.joints[0], arm.shape[1]
        if len(set(arm.joints)) > 1 or not isinstance(joint, FreeColumn | UnitRevolute):
            raise InputError("joints", arm.description, "all free columns or all unit revolute")
        while True:
            parts = int(rng.integers(2, 2 * joints + 1 if rng.random() < 0.5 else 7))
            symmetry = _drawn_map(joint, parts, rng)
            order = _order(symmetry, joints)
            if order is not None and order > 1:
                return cls(arm, tuple(map(tuple, symmetry.tolist())), order)

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""
        return self.arm.shape

    @property
    def size(self) -> int:
        """Number of variables: the parameters of one column of each orbit."""
        return self._orbits * len(self.arm.joints[0].parameters)

    @property
    def fixed_trace(self) -> float | None:
        """‖J‖_F² where every Jacobian of the arm has the same; None otherwise."""
        return self.arm.fixed_trace

    @property
    def description(self) -> str:
        """The joints, and the order of the symmetry."""
        return f"{self.arm.description}, symmetric under a map of order {self.order}"

    def symbols(self) -> ca.SX:
        """Symbols of the parameters of one column of each orbit, shape (size, 1)."""
        return ca.SX.sym("x", self.size)

    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian, shape (m, n), orbit after orbit."""
        joint, symmetry = self.arm.joints[0], ca.DM(np.array(self.symmetry))
        columns: list[ca.SX] = []
        for part in ca.vertsplit(variables, len(joint.parameters)):
            columns.append(joint.column(part))
            if len(columns) + self.order <= self.shape[1] + 1:
                for _ in range(self.order - 1):
                    columns.append(symmetry @ columns[-1])
        return ca.horzcat(*columns)

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:
        """Return the arm's bounds on its columns: none of unit revolute joints."""
        if isinstance(self.arm.joints[0], UnitRevolute):
            return ()
        return self.arm.constraints(ca.vec(self.matrix(variables)))

    def admits(self, jacobian: FloatArray, variables: FloatArray | None = None) -> bool:
        """Whether it is a Jacobian of the arm; that it is symmetric is not checked."""
        return self.arm.admits(jacobian, variables)

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw one column of each orbit at random."""
        return np.concatenate(list(self.arm.joints[0].sample(rng, self._orbits)))

    def distinct_sets(self, locked: int) -> list[tuple[int, ...]]:
        """Return one of each orbit of sets of `locked` joints; all if n mod p is not 0."""
        sets = list(combinations(range(self.shape[1]), locked))
        if self.shape[1] % self.order:
            return sets
        p = self.order

        def images(joints: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
            for shift in range(p):
                yield tuple(sorted(i - i % p + (i + shift) % p for i in joints))

        return [chosen for chosen in sets if chosen == min(images(chosen))]

    @property
    def _orbits(self) -> int:
        whole, rest = divmod(self.shape[1], self.order)
        return whole + rest


def _drawn_map(joint: Joint, parts: int, rng: np.random.Generator) -> FloatArray:
    """Return a map by angles that are multiples of 2π/`parts`, and perhaps a reflection.

    Of free columns every orthogonal map of finite order is one of these in some frame. Of unit
    revolute columns it turns v and ω alike in space, and in the plane that v and ω span.
    """
    from scipy.linalg import block_diag

    def rotation() -> FloatArray:
        angle = 2 * np.pi * int(rng.integers(parts)) / parts
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    side = np.array([[rng.choice([-1.0, 1.0])]])
    if isinstance(joint, UnitRevolute):
        return np.asarray(np.kron(rotation(), block_diag(rotation(), side)))
    half, odd = divmod(joint.dimension, 2)
    return np.asarray(block_diag(*(rotation() for _ in range(half)), *[side] * odd))


def _order(symmetry: FloatArray, most: int) -> int | None:
    """Return the least power that is 1 or −1; None if it is above `most`."""
    power, identity = symmetry, np.eye(len(symmetry))
    for order in range(1, most + 1):
        if min(np.abs(power - identity).max(), np.abs(power + identity).max()) < 1e-9:
            return order
        power = power @ symmetry
    return None
