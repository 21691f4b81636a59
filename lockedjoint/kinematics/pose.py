"""A pose of a tool, and how nearly it is to be reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from lockedjoint.formulations.io.objects import Brief, takes
from lockedjoint.kinematics.chain import LARGEST, Chain
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.tool_poses import ToolPoses
from lockedjoint.nlp.arrays import FloatArray, as_floats, real_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Constraint

#: A position beyond this may be in millimetres.
FAR_M = 20.0


def asks_for_millimetres(position: FloatArray, remedy: str) -> str:
    """Return the end of a sentence on a position, (3,), that may be millimetres, or nothing."""
    far = bool(np.max(np.abs(position)) > FAR_M)
    return f"; in millimetres? {remedy}" if far else ""


@dataclass(frozen=True, repr=False)
class Pose(Brief):
    """The position that the tip's point has to reach, its orientation, and tolerances.

    All of it is along the axes of the base.

    Parameters
    ----------
    position
        Metres.
    quaternion
        Orientation of the tip's link, scalar last, of length 1; None if it is free.
    tolerance
        Largest distance from the position, metres.
    angle
        Largest angle from the orientation, radians, below π.
    notes
        What to check of the numbers, one sentence each.

    Raises
    ------
    InputError
        If a number is out of range, or an angle is given and no orientation.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Pose((0.45, 0.1, 0.4))
    <Pose: position (0.45, 0.1, 0.4)>
    """

    position: tuple[float, ...]
    quaternion: tuple[float, ...] | None = None
    tolerance: float = 0.0
    angle: float = 0.0
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        position = as_floats("position", self.position)
        if position.shape != (3,) or not np.all(np.abs(position) <= LARGEST):
            raise InputError("position", self.position, "three finite numbers, in metres")
        given = (0, 0, 0, 1) if self.quaternion is None else self.quaternion
        unit = as_floats("quaternion", given)
        if not (unit.shape == (4,) and abs(np.linalg.norm(unit) - 1) < 1e-6):
            allowed = "four numbers of length 1, scalar last"
            raise InputError("quaternion", self.quaternion, allowed)
        # Tuples are hashable, as an arm at a pose has to be.
        object.__setattr__(self, "position", tuple(position.tolist()))
        if self.quaternion is not None:
            object.__setattr__(self, "quaternion", tuple(unit.tolist()))
        real_number("tolerance", self.tolerance, "at least 0, in metres", 0, LARGEST)
        allowed = "an angle of at least 0 and below π"
        real_number("tolerance", self.angle, allowed, 0, np.nextafter(np.pi, 0))
        if self.angle and self.quaternion is None:
            allowed = "an angle only where the pose has an orientation"
            raise InputError("tolerance", self.angle, allowed)

    @takes("METRES, or METRES and RADIANS, in a row")
    def within(self, tolerance: Sequence[float]) -> Pose:
        """Return the pose with tolerances: metres, and radians if it has an orientation."""
        if len(tolerance) > (1 if self.quaternion is None else 2):
            words = "METRES" if self.quaternion is None else "METRES or METRES,RADIANS"
            shown = ",".join(map(str, tolerance))
            raise InputError("tolerance", shown, f"{words} for such a pose")
        distance, angle = (*tolerance, 0.0, 0.0)[:2]
        return replace(self, tolerance=distance, angle=angle)

    @property
    def rows(self) -> range:
        """Directions that it fixes: three, or all six."""
        return range(3 if self.quaternion is None else 6)

    @property
    def rotation(self) -> FloatArray:
        """Shape (3, 3); the identity if the orientation is free."""
        from scipy.spatial.transform import Rotation  # takes long to load

        return np.asarray(Rotation.from_quat(self.quaternion or (0, 0, 0, 1)).as_matrix())

    @property
    def target(self) -> ToolPoses:
        """The pose as inverse kinematics takes it, for all configurations."""
        rotation = self.rotation[:, :, None]
        return ToolPoses(np.array(self.position)[:, None], rotation, self.rows)

    @takes("symbols of shape (3, 1) and (3, 3)")
    def constraints(self, origin: ca.SX, rotation: ca.SX) -> tuple[Constraint, ...]:
        """State that a tip is there, from its position (3, 1) and rotation (3, 3)."""
        off = origin - ca.DM(self.position)
        # The trace falls short of 3 by 2 (1 − cos φ), φ the angle between the two rotations.
        # So one constraint is (1 − cos φ)/(1 − cos angle) ≤ 1, which is smooth at φ = 0. The
        # other one, without a tolerance, is sin φ = 0 about each axis: half a turn has it, too.
        product = rotation @ ca.DM(self.rotation.T)
        blocks = [
            Constraint("position", ca.sumsqr(off) / self.tolerance**2, -np.inf, 1.0)
            if self.tolerance
            else Constraint("position", off, 0.0, 0.0)
        ]
        if self.quaternion is not None and self.angle:
            versine_ratio = (3 - ca.trace(product)) / (2 * (1 - np.cos(self.angle)))
            blocks.append(Constraint("orientation", versine_ratio, -np.inf, 1.0))
        elif self.quaternion is not None:
            sines = ca.inv_skew((product - product.T) / 2)
            blocks.append(Constraint("orientation", sines, 0.0, 0.0))
        return tuple(blocks)

    @takes("a chain and configurations of shape (n, B)")
    def errors(self, chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances and angles from the pose of configurations (n, B), shape (B,) each."""
        missing = self.target.missing(*chain.tip_at(q))
        turn = missing[3 : len(self.rows)]  # none where the orientation is free
        return np.linalg.norm(missing[:3], axis=0), np.linalg.norm(turn, axis=0)

    @takes("two arrays of one shape, and a number")
    def reached(self, errors: tuple[FloatArray, FloatArray], slack: float) -> BoolArray:
        """Whether distances and angles, (B,) each, are within the tolerances and a slack.

        The slack is added to each tolerance: metres and radians.
        """
        return (errors[0] <= self.tolerance + slack) & (errors[1] <= self.angle + slack)
