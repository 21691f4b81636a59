"""Read a robot from a model of pinocchio."""

from __future__ import annotations

from typing import Any

import numpy as np

from formulations.kinematics.tree import Limit, Mimic, RobotTree, TreeJoint
from nlp.arrays import FloatArray


def pinocchio_tree(model: Any) -> RobotTree:
    """Return the robot of a `pinocchio.Model`.

    The links are the bodies: a joint's is named after the first body frame in its place, or
    after the joint. Other frames of bodies and operational frames are links fixed to them.
    A joint of more than one degree of freedom cannot be part of a chain.
    """
    frames = [
        (frame.name, int(frame.parentJoint), np.array(frame.placement.homogeneous))
        for frame in model.frames
        if frame.type.name in ("BODY", "OP_FRAME")
    ]
    links = ["universe", *list(model.names)[1:]]
    named: set[str] = set()
    for title, joint, pose in frames:
        if links[joint] not in named and np.allclose(pose, np.eye(4), rtol=0, atol=1e-15):
            links[joint] = title
            named.add(title)
    followed = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    joints = []
    for k in range(1, model.njoints):
        joint, title = model.joints[k], model.names[k]
        kind, axis = _pinocchio_motion(joint)
        limit, mimic = Limit(), None
        if k in followed:
            own = joint.extract()
            mimic = Mimic(model.names[followed[k]], float(own.scaling), float(own.offset))
            axis = axis / own.scaling if own.scaling else axis
        elif kind in ("revolute", "prismatic"):
            lower = float(model.lowerPositionLimit[joint.idx_q])
            upper = float(model.upperPositionLimit[joint.idx_q])
            limit = Limit(lower, upper, float(model.velocityLimit[joint.idx_v]))
        ends = links[model.parents[k]], links[k]
        origin = model.jointPlacements[k].homogeneous
        joints.append(TreeJoint(*ends, title, kind, origin, axis, limit, mimic))
    others = [one for one in frames if one[0] not in named]
    joints += [
        TreeJoint(links[joint], title, f"fixed {title}", "fixed", pose)
        for title, joint, pose in others
    ]
    names = (*links, *(title for title, _, _ in others))
    return RobotTree(model.name or "robot", names, tuple(joints))


def _pinocchio_motion(joint: Any) -> tuple[str, FloatArray]:
    """Return kind and axis of a joint, from the subspace (v; ω) of its motion."""
    screw = np.array(joint.createData().S, dtype=float).T
    kind = joint.shortname().removeprefix("JointModel")
    # Helical joints, whose name begins with H, turn and move along.
    if screw.shape != (6,) or not kind.startswith(("R", "P", "Mimic")):
        return kind, np.zeros(3)
    if np.any(screw[3:]):
        return "continuous" if joint.nq == 2 else "revolute", screw[3:]
    return "prismatic", screw[:3]
