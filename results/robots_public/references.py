"""The Jacobian of a chain by others: by differences, by pinocchio and by mujoco.

All three answer what `RobotArm.metric_jacobian` answers, so that they can be compared: the
velocity (v; ω) of the tip at its origin, in the axes of the chain's base, shape (6, n), for n
free joints between base and tip, in the order of `chain.names`. Configurations q have shape
(n,), in radians, or metres of joints that slide.

The others know the whole robot, so they are given a position of every joint on the way to the
tip (`positions`). A joint that follows another (mimic: position = multiplier · position of the
other + offset) has a column of its own there; times the multiplier it is added to the column of
the other (`_of_joints`). The angular and the linear part are turned into the base's axes by
np.kron(I, Rᵀ), shape (6, 6), where R is the base's rotation in the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.arrays import FloatArray

# Differences are taken over twice this. A larger step makes errors of the order of its square;
# a smaller one loses digits.
_STEP_M_OR_RAD = 1e-6


def by_differences(chain: Chain, q: FloatArray) -> FloatArray:
    """Return (v; ω) of the tip, shape (6, n), by differences of where it is."""
    columns = []
    for step in _STEP_M_OR_RAD * np.eye(len(q)):
        ends = [chain.tip_at((q + sign * step)[:, None]) for sign in (1, -1)]
        (ahead, turned), (behind, before) = ends
        moved = (ahead - behind)[:, 0]
        vector = Rotation.from_matrix(turned[..., 0] @ before[..., 0].T).as_rotvec()
        columns.append(np.concatenate([moved, vector]) / (2 * _STEP_M_OR_RAD))
    return np.stack(columns, axis=1)


def by_pinocchio(path: Path, tree: RobotTree, chain: Chain, q: FloatArray) -> FloatArray:
    """Return the same by pinocchio's reader and Jacobian, of a URDF file."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path))
    data, full = model.createData(), pin.neutral(model)
    for name, value in positions(tree, chain, q).items():
        joint = model.joints[model.getJointId(name)]
        both = value if joint.nq == 1 else [np.cos(value), np.sin(value)]
        full[joint.idx_q : joint.idx_q + joint.nq] = both
    frame = model.getFrameId(chain.tip, pin.FrameType.BODY)
    matrix = pin.computeFrameJacobian(model, data, full, frame, pin.LOCAL_WORLD_ALIGNED)
    matrix = matrix.reshape(6, model.nv)  # of one joint it is a vector
    pin.updateFramePlacements(model, data)
    turn = data.oMf[model.getFrameId(chain.base, pin.FrameType.BODY)].rotation
    columns = {
        name: matrix[:, model.joints[model.getJointId(name)].idx_v]
        for name in positions(tree, chain, q)
    }
    return np.kron(np.eye(2), turn.T) @ _of_joints(tree, chain, columns)


def by_mujoco(path: Path, tree: RobotTree, chain: Chain, q: FloatArray) -> FloatArray:
    """Return the same by mujoco, of an MJCF file."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    joints = {model.joint(k).name or f"joint_{k}": k for k in range(model.njnt)}
    for name, value in positions(tree, chain, q).items():
        data.qpos[model.jnt_qposadr[joints[name]]] = value
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    bodies = {model.body(k).name or f"body_{k}": k for k in range(model.nbody)}
    sites = {model.site(k).name or f"site_{k}": k for k in range(model.nsite)}
    matrix = np.zeros((6, model.nv))
    tip = chain.tip.removesuffix(" (site)")
    if chain.tip in bodies:
        mujoco.mj_jacBody(model, data, matrix[:3], matrix[3:], bodies[chain.tip])
    else:
        mujoco.mj_jacSite(model, data, matrix[:3], matrix[3:], sites[tip])
    turn = data.xmat[bodies[chain.base]].reshape(3, 3)
    columns = {
        name: matrix[:, model.jnt_dofadr[joints[name]]] for name in positions(tree, chain, q)
    }
    return np.kron(np.eye(2), turn.T) @ _of_joints(tree, chain, columns)


def positions(tree: RobotTree, chain: Chain, q: FloatArray) -> dict[str, float]:
    """Return where each moving joint on the way to the tip is, in radians or metres."""
    known = {**dict(zip(chain.names, q.tolist(), strict=True)), **dict(chain.immobile)}
    found = {}
    for joint in tree.path(chain.tip):
        driver, multiplier, offset = _driver(tree, joint.name)
        if driver in known:
            found[joint.name] = multiplier * known[driver] + offset
    return found


def _of_joints(tree: RobotTree, chain: Chain, columns: Mapping[str, FloatArray]) -> FloatArray:
    """Return J, shape (6, n), from columns, shape (6,), of all joints on the way, by name.

    Columns of joints that follow are added to those of the joints that they follow.
    """
    matrix = np.zeros((6, len(chain.names)))
    for name, column in columns.items():
        driver, multiplier, _ = _driver(tree, name)
        if driver in chain.names:
            matrix[:, chain.names.index(driver)] += multiplier * column
    return matrix


def _driver(tree: RobotTree, name: str) -> tuple[str, float, float]:
    """Return the joint that a joint follows, mostly itself; a multiplier and an offset.

    The joint that is followed may itself follow another: the last of them is returned.
    """
    named = {joint.name: joint for joint in tree.joints}
    multiplier, offset = 1.0, 0.0
    while (mimic := named[name].mimic) is not None:
        offset += multiplier * mimic.offset
        multiplier *= mimic.multiplier
        name = mimic.joint
    return name, multiplier, offset
