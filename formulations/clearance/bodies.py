"""Links of a robot that move as one, and where they are: the whole tree, not one chain.

Joints that do not move the tip stay: at zero, or at the limit nearest to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from formulations.kinematics.chain import Chain, Motion
from formulations.kinematics.chain_between import displacement, driven_joint, motion_of
from formulations.kinematics.forward import displaced
from formulations.kinematics.tree import MOVING, RobotTree
from nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Bodies:
    """The bodies of a robot. Body 0 holds the root and does not move.

    Attributes
    ----------
    size
        Number of the chain's free joints.
    moving
        Of bodies 1, 2, …, parents first: the number of the body before each one's joint, and
        the joint's motion.
    """

    size: int
    moving: tuple[tuple[int, Motion], ...]

    def parent(self, body: int) -> int:
        """Return the number of the body before a body's joint; -1 for body 0."""
        return self.moving[body - 1][0] if body else -1

    def placed(self, positions: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
        """Rotation (3, 3) and origin (3, 1) of each body, from symbols of the positions."""
        rotations, origins = [ca.SX.eye(3)], [ca.SX.zeros(3)]
        for parent, motion in self.moving:
            rotation, origin = displaced(rotations[parent], origins[parent], motion, positions)
            rotations.append(rotation)
            origins.append(origin)
        return rotations, origins

    def frames(self, configurations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (bodies, 3, 3, B) and origins (bodies, 3, B) at configurations (n, B)."""
        rotations, origins = (np.array(one) for one in self._kinematics(configurations))
        count = len(self.moving) + 1
        # CasADi's vectors are column by column.
        rotations = rotations.reshape(count, 3, 3, -1).transpose(0, 2, 1, 3)
        return rotations, origins.reshape(count, 3, -1)

    @cached_property
    def _kinematics(self) -> ca.Function:
        q = ca.SX.sym("q", self.size)
        rotations, origins = self.placed(q)
        return ca.Function(
            "bodies", [q], [ca.vertcat(*map(ca.vec, rotations)), ca.vertcat(*origins)]
        )

    def __getstate__(self) -> dict[str, object]:
        """Travel to other processes without what CasADi made."""
        return {k: v for k, v in self.__dict__.items() if not k.startswith("_")}


def bodies_of(
    tree: RobotTree, chain: Chain
) -> tuple[Bodies, dict[str, tuple[int, FloatArray]]]:
    """Return what moves as one when the chain's joints move.

    Parameters
    ----------
    tree
        The robot.
    chain
        Its joints that move.

    Returns
    -------
    Bodies
        The bodies.
    dict
        Of each link the number of its body, and its pose in the body's frame, 4×4.
    """
    by_name = {joint.name: joint for joint in tree.joints}
    fixed = dict((*chain.immobile, *chain.locked_at))
    moving: list[tuple[int, Motion]] = []
    places: dict[str, tuple[int, FloatArray]] = {tree.root: (0, np.eye(4))}
    for joint in tree.parents_first:
        body, pose = places[joint.parent]
        pose = pose @ np.asarray(joint.origin)
        if joint.type in MOVING:
            _, driver, multiplier, offset = driven_joint(by_name, joint)
            if driver.name in chain.names and multiplier != 0:
                variable = chain.names.index(driver.name)
                motion = motion_of(joint, pose, variable, multiplier, offset)
                moving.append((body, motion))
                body, pose = len(moving), np.eye(4)
            else:
                still = float(np.clip(0.0, driver.limit.lower, driver.limit.upper))
                value = multiplier * fixed.get(driver.name, still) + offset
                pose = pose @ displacement(joint, value)
        places[joint.child] = (body, pose)
    return Bodies(len(chain.joints), tuple(moving)), places
