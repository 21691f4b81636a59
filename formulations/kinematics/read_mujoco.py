"""Read a robot from a model of mujoco."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from formulations.kinematics.tree import Limit, Mimic, RobotTree, joint_between
from nlp.arrays import FloatArray


def mujoco_tree(model: Any) -> RobotTree:
    """Return the robot of a `mujoco.MjModel`.

    Bodies and sites are links. Positions of joints count as in ``qpos``. An equality that
    makes one joint a linear function of another is mimicry; joints that any other active
    equality couples, and ball and free joints, cannot be part of a chain. Tendons, and welds
    to mocap bodies, are not looked at.
    """
    import mujoco

    bodies = _names(model.body, model.nbody, "body")
    titles = _names(model.joint, model.njnt, "joint")
    sites = _names(model.site, model.nsite, "site")
    # A body and a site may have the same name.
    sites = [f"{one} (site)" if one in bodies else one for one in sites]
    followed, coupled = _equalities(model, titles)
    kinds = {
        int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
        int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    }
    links, joints = list(bodies), []
    for body in range(1, model.nbody):
        parent = bodies[model.body_parentid[body]]
        carried = _placed(model.body_pos[body], model.body_quat[body])
        for k in _joints_of(model, body):
            kind = kinds.get(int(model.jnt_type[k]), "ball or free")
            kind = "coupled by an equality" if k in coupled else kind
            anchor, axis = _placed(model.jnt_pos[k]), model.jnt_axis[k]
            reference = -float(model.qpos0[model.jnt_qposadr[k]])
            # Joints of one body move it one after the other, each about its own anchor.
            origin = carried @ anchor
            if kind == "revolute":
                origin = origin @ _placed(np.zeros(3), _turned(axis, reference))
            elif kind == "prismatic":
                origin = origin @ _placed(reference * axis)
            limit = Limit(*model.jnt_range[k].tolist()) if model.jnt_limited[k] else Limit()
            whole = k == _joints_of(model, body)[-1] and not np.any(model.jnt_pos[k])
            child = bodies[body] if whole else f"after {titles[k]}"
            links += [] if whole else [child]
            more = (origin, axis, limit, followed.get(k))
            joints.append(joint_between(parent, child, titles[k], kind, *more))
            parent, carried = child, _placed(-model.jnt_pos[k])
        if parent != bodies[body]:
            title = f"fixed {bodies[body]}"
            joints.append(joint_between(parent, bodies[body], title, "fixed", carried))
    for k, title in enumerate(sites):
        place = _placed(model.site_pos[k], model.site_quat[k])
        on = bodies[model.site_bodyid[k]]
        joints.append(joint_between(on, title, f"fixed {title}", "fixed", place))
    name = model.names.split(b"\0", 1)[0].decode("utf-8", "replace")
    return RobotTree(name or "robot", (*links, *sites), tuple(joints))


def _equalities(model: Any, titles: list[str]) -> tuple[dict[int, Mimic], set[int]]:
    """Return which joints follow others, and which are coupled in any other way."""
    from mujoco import mjtEq, mjtObj

    followed: dict[int, Mimic] = {}
    coupled: set[int] = set()
    for k in np.flatnonzero(model.eq_active0):
        kind, one, other = (
            int(v[k]) for v in (model.eq_type, model.eq_obj1id, model.eq_obj2id)
        )
        if kind == mjtEq.mjEQ_JOINT:
            # q - q0 = a0 + a1 (p - p0) + a2 (p - p0)^2 + …
            shift, factor, *curved = model.eq_data[k, :5].tolist()
            if other < 0 or any(curved) or one in followed:
                coupled.add(one)
                continue
            zero, driver = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (one, other))
            followed[one] = Mimic(titles[other], factor, zero + shift - factor * driver)
        elif kind in (mjtEq.mjEQ_CONNECT, mjtEq.mjEQ_WELD):
            if model.eq_objtype[k] == mjtObj.mjOBJ_SITE:
                one, other = int(model.site_bodyid[one]), int(model.site_bodyid[other])
            if model.body_mocapid[one] < 0 and model.body_mocapid[other] < 0:
                # A loop: every joint on it, from where the two branches part.
                loop = _joints_below_root(model, one) ^ _joints_below_root(model, other)
                coupled |= loop
    return followed, coupled


def _joints_below_root(model: Any, body: int) -> set[int]:
    found: set[int] = set()
    while body > 0:
        found.update(_joints_of(model, body))
        body = int(model.body_parentid[body])
    return found


def _joints_of(model: Any, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def _names(named: Any, count: int, kind: str) -> list[str]:
    """Return the names of a model's bodies, joints or sites; those without have a number."""
    return [named(k).name or f"{kind}_{k}" for k in range(count)]


def _placed(position: FloatArray, quaternion: FloatArray | None = None) -> FloatArray:
    """Return a pose, 4×4, from a position and a quaternion (w, x, y, z)."""
    pose = np.eye(4)
    pose[:3, 3] = position
    if quaternion is not None:
        w, x, y, z = (np.asarray(quaternion) / np.linalg.norm(quaternion)).tolist()
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    return pose


def _turned(axis: FloatArray, angle: float) -> FloatArray:
    """Return the quaternion (w, x, y, z) of a rotation about a unit vector."""
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
