"""Arms with a symmetry: a map of finite order carries their columns into one another.

The letters: m, n are rows and columns of the Jacobian, G is the map, an orthogonal matrix of
shape (m, m), p its order, c the first column of an orbit, shape (m,). Columns (v; ω) of unit
revolute joints have three rows of velocity and three of rotation. `search` uses these arms: an
optimum that is symmetric is found with few variables.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import casadi as ca
import numpy as np
from scipy.linalg import block_diag

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel, Joint
from lockedjoint.formulations.joints.kinds import FreeColumn, UnitRevolute
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Constraint

# Probability that a map is drawn with angles of any order up to twice the number of joints;
# otherwise they are of a low order, as most good optima have. A larger value tries more orders,
# and each of the low ones less often.
_ANY_ORDER = 0.5
# Largest number of parts of the full circle of a low order.
_LOW_PARTS = 6
# Largest entry of Gᵖ ∓ 1 that counts as zero: far above rounding, and far below what the next
# possible angle changes.
_IDENTITY_TOLERANCE = 1e-9


@dataclass(frozen=True)
class SymmetricArm(ArmModel):
    """Columns in orbits c, Gc, …, Gᵖ⁻¹c of a map G with Gᵖ = ±1, of joints of one kind.

    The worst case after a set of joints locks is that after the set that G makes of it. The
    last n mod p columns make no whole orbit, and are free.

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
        """Draw G at random.

        Raises
        ------
        InputError
            If the joints are not of one kind, free columns or unit revolute.
        """
        joint, joints = arm.joints[0], arm.shape[1]
        if len(set(arm.joints)) > 1 or not isinstance(joint, FreeColumn | UnitRevolute):
            raise InputError("joints", arm.description, "all free columns or all unit revolute")
        while True:
            most = 2 * joints if rng.random() < _ANY_ORDER else _LOW_PARTS
            parts = int(rng.integers(2, most + 1))
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

    def distinct_sets(self, failures: int) -> list[tuple[int, ...]]:
        """Return one of each orbit of sets of `failures` joints; all if n mod p is not 0."""
        sets = list(combinations(range(self.shape[1]), failures))
        if self.shape[1] % self.order:
            return sets
        p = self.order

        def images(joints: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
            # Joint i is number i mod p of its orbit, and G makes it the next one.
            for shift in range(p):
                yield tuple(sorted(i - i % p + (i + shift) % p for i in joints))

        return [chosen for chosen in sets if chosen == min(images(chosen))]

    @property
    def _orbits(self) -> int:
        """Number of columns that are variable: one of each whole orbit, and the free ones."""
        whole, rest = divmod(self.shape[1], self.order)
        return whole + rest


def _drawn_map(joint: Joint, parts: int, rng: np.random.Generator) -> FloatArray:
    """Return a map by angles that are multiples of 2π/`parts`, and perhaps a reflection.

    Of free columns every orthogonal map of finite order is one of these in some frame. Of unit
    revolute columns the map turns all v and ω alike in space, and in the plane that v and ω
    span.
    """

    def rotation() -> FloatArray:
        angle = 2 * np.pi * int(rng.integers(parts)) / parts
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    reflection = np.array([[rng.choice([-1.0, 1.0])]])
    if isinstance(joint, UnitRevolute):
        return np.asarray(np.kron(rotation(), block_diag(rotation(), reflection)))
    half, odd = divmod(joint.dimension, 2)
    planes = [rotation() for _ in range(half)]
    return np.asarray(block_diag(*planes, *[reflection] * odd))


def _order(symmetry: FloatArray, most: int) -> int | None:
    """Return the least power that is 1 or −1; None if it is above `most`."""
    power, identity = symmetry, np.eye(len(symmetry))
    for order in range(1, most + 1):
        distances = (np.abs(power - identity).max(), np.abs(power + identity).max())
        if min(distances) < _IDENTITY_TOLERANCE:
            return order
        power = power @ symmetry
    return None
