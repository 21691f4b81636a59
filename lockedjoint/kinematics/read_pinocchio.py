"""Read a robot from a model of pinocchio.

What comes in: a `pinocchio.Model`. What goes out: a `RobotTree` of the same joints, with the
positions as pinocchio counts them. Pinocchio itself is not imported.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lockedjoint.kinematics.tree import Limit, Mimic, RobotTree, TreeJoint, unused
from lockedjoint.nlp.arrays import FloatArray

# These frames become links: bodies, and the points that a user marked.
_FRAMES_THAT_ARE_LINKS = ("BODY", "OP_FRAME")
# A frame is in its joint's place if no entry of its pose differs by more from the identity. If
# this is larger, frames beside the joint give their names to the joint's link.
_ROUNDING = 1e-15


def pinocchio_tree(model: Any) -> RobotTree:
    """Return the robot of a `pinocchio.Model`.

    A link is a body. The body that moves with a joint has the name of the first body frame in
    the joint's place, or of the joint. Other frames of bodies and operational frames become
    links that are fixed to it. A joint of more than one degree of freedom cannot be part of a
    chain.
    """
    frames = [
        (frame.name, int(frame.parentJoint), np.array(frame.placement.homogeneous))
        for frame in model.frames
        if frame.type.name in _FRAMES_THAT_ARE_LINKS
    ]
    links, frames_in_place = _links_of_joints(list(model.names), frames)
    joints = [_joint(model, number, links) for number in range(1, model.njoints)]
    link_names, joint_names = list(links), set(model.names)
    for number, (name, joint, pose) in enumerate(frames):
        if number in frames_in_place:
            continue
        # A body and an operational frame may have the same name.
        link = unused(name, link_names)
        link_names.append(link)
        joint_name = unused(f"fixed {link}", joint_names)
        joint_names.add(joint_name)
        joints.append(TreeJoint(links[joint], link, joint_name, "fixed", pose))
    return RobotTree(model.name or "robot", tuple(link_names), tuple(joints))


def _links_of_joints(
    joint_names: list[str], frames: list[tuple[str, int, FloatArray]]
) -> tuple[list[str], set[int]]:
    """Return the link that moves with each joint, and which frames gave it their names.

    A frame is a name, the number of the joint that moves it, and its pose there, 4×4.
    """
    frame_names = [name for name, _, _ in frames]
    links = [unused(name, frame_names) for name in ("universe", *joint_names[1:])]
    first_in_place: dict[int, int] = {}
    for number, (_, joint, pose) in enumerate(frames):
        in_place = np.allclose(pose, np.eye(4), rtol=0, atol=_ROUNDING)
        if in_place and joint not in first_in_place:
            first_in_place[joint] = number
            links[joint] = frame_names[number]
    return links, set(first_in_place.values())


def _joint(model: Any, number: int, links: list[str]) -> TreeJoint:
    """Return the joint of a number between its links."""
    joint = model.joints[number]
    kind, axis = _kind_and_axis(joint)
    limit, mimic = Limit(), None
    followed = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    if number in followed:
        ratio = joint.extract()
        leader = model.names[followed[number]]
        mimic = Mimic(leader, float(ratio.scaling), float(ratio.offset))
        # The subspace of a joint that follows another is scaled by the ratio.
        axis = axis / ratio.scaling if ratio.scaling else axis
    elif kind in ("revolute", "prismatic"):
        lower = float(model.lowerPositionLimit[joint.idx_q])
        upper = float(model.upperPositionLimit[joint.idx_q])
        limit = Limit(lower, upper, float(model.velocityLimit[joint.idx_v]))
    return TreeJoint(
        parent=links[model.parents[number]],
        child=links[number],
        name=model.names[number],
        type=kind,
        origin=model.jointPlacements[number].homogeneous,
        axis=axis,
        limit=limit,
        mimic=mimic,
    )


def _kind_and_axis(joint: Any) -> tuple[str, FloatArray]:
    """Return kind and axis of a joint, from the subspace (v; ω) of its motion."""
    motion = np.array(joint.createData().S, dtype=float).T
    kind = joint.shortname().removeprefix("JointModel")
    # Helical joints, whose name begins with H, turn and move along.
    if motion.shape != (6,) or not kind.startswith(("R", "P", "Mimic")):
        return kind, np.zeros(3)
    linear, angular = motion[:3], motion[3:]
    if np.any(angular):
        return "continuous" if joint.nq == 2 else "revolute", angular
    return "prismatic", linear
