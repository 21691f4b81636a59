"""Links of a robot that move as one, and where they are: the whole tree, not one chain.

Joints that do not move the tip stay: at zero, or at the limit nearest to it.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from formulations.kinematics.chain import Chain, Motion
from formulations.kinematics.chain_between import displacement, driven_joint, motion_of
from formulations.kinematics.tree import MOVING, RobotTree
from nlp.arrays import FloatArray

#: Of bodies 1, 2, …, parents first: the number of the body before each one's joint, and the
#: joint's motion. Body 0 holds the root and does not move.
Bodies: TypeAlias = tuple[tuple[int, Motion], ...]


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
    return tuple(moving), places
