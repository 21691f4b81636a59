"""Robots made for the tests, mostly as URDF text; the fixture `made` is this module."""

from functools import lru_cache

import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.clearance.read_clearance import Obstacles
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import MissingLibraryError
from results.robots.survey import ARMS


def joint(
    name, parent, child, kind="revolute", xyz="0 0 0.3", rpy="0 0 0", axis="0 0 1", **more
):
    limit = more.get("limit", 'lower="-2" upper="2" effort="1" velocity="1"')
    limited = f"<limit {limit}/>" if kind in ("revolute", "prismatic") and limit else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limited}{more.get("mimic", "")}'
        "</joint>"
    )


def urdf(joints, links=None, name="made"):
    if links is None:
        links = dict.fromkeys(end for one in joints for end in _ends(one))
    listed = "".join(f'<link name="{link}"/>' for link in links)
    return f'<robot name="{name}">{listed}{"".join(joints)}</robot>'


def _ends(text):
    return [part.split('"')[1] for part in text.split("link=")[1:3]]


AXES = ("0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def serial(offsets, axes=AXES, **kinds):
    """A serial arm: joint k named jk turns about axes[k] at offsets[k] from the one before.

    What is given under the name of a joint goes to `joint`.
    """
    return [
        joint(f"j{k}", f"l{k}", f"l{k + 1}", xyz=xyz, axis=axis, **kinds.get(f"j{k}", {}))
        for k, (xyz, axis) in enumerate(zip(offsets, axes, strict=True))
    ]


def with_shapes(text, links, shape):
    """The same URDF text, with a shape to collide with on some of its links lk."""
    solid = f"<collision><geometry>{shape}</geometry></collision>"
    for k in links:
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{solid}</link>')
    return text


def obstacle(folder, place, shape):
    """The obstacle `thing` of one shape at a place, read from a file in the folder."""
    text = f'<origin xyz="{place}"/><geometry>{shape}</geometry>'
    text = f'<link name="thing"><collision>{text}</collision></link>'
    (folder / "cell.urdf").write_text(f'<robot name="cell">{text}</robot>')
    return Obstacles.read(folder / "cell.urdf")


def spherical_shoulder_and_wrist():
    """Seven joints, the axes of 0–2 meet in the shoulder, those of 4–6 in the wrist."""
    return urdf(serial(["0 0 0"] * 3 + ["0 0 0.4", "0 0 0.4", "0 0 0", "0 0 0"]))


def offset_arm(joints=7):
    """No two axes meet: every failure leaves something."""
    offsets = ["0.1 0.05 0.3", "0.2 0 0.1", "0 0.15 0.2", "0.1 0 0.25"] * 2
    kinds = {f"j{k}": {"rpy": "0.4 0.7 0.2"} for k in range(joints)}
    return urdf(serial(offsets[:joints], (AXES * 2)[:joints], **kinds))


def tree(text):
    return urdf_tree(xml_root(text.encode()))


def chain(robot, tip=None, **more):
    """A chain of URDF text, or of joints as `joint` writes them, to the last link."""
    whole = tree(robot if isinstance(robot, str) else urdf(robot))
    return chain_between(whole, tip or whole.leaves[0], **more)


def arm(text, tip=None, task="all", frame="base", length=None, **more):
    """An arm of URDF text; what is more goes to `chain_between`."""
    return RobotArm(chain(text, tip, **more), TaskSpace.parse(task, frame), length)


def planar_urdf(lengths, limit='lower="-2" upper="2" effort="1" velocity="1"'):
    """A robot in the plane, whose joints turn about parallel axes."""
    places = ["0 0 0", *(f"{one} 0 0" for one in lengths)]
    kinds = {f"j{k}": {"limit": limit} for k in range(len(lengths))}
    joints = serial(places[:-1], ["0 0 1"] * len(lengths), **kinds)
    tool = joint("tool", f"l{len(lengths)}", "tip", "fixed", xyz=places[-1])
    return urdf([*joints, tool])


def planar(lengths, task="vx,vy", **more):
    """An arm in the plane."""
    return arm(planar_urdf(lengths, **more), "tip", task)


def in_pinocchio(model, names, point):
    """Pinocchio's configuration with joints at positions, and their columns of its J."""
    q, columns = pin.neutral(model), []
    for name, value in zip(names, point, strict=True):
        joint = model.joints[model.getJointId(name)]
        both = value if joint.nq == 1 else [np.cos(value), np.sin(value)]
        q[joint.idx_q : joint.idx_q + joint.nq] = both
        columns.append(joint.idx_v)
    return q, columns


def pose_in_pinocchio(model, names, point, link):
    """The pose of a link with joints at positions, as pinocchio's SE3."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, in_pinocchio(model, names, point)[0])
    return data.oMf[model.getFrameId(link)].copy()


def of_pinocchio(model, chain, point):
    """Pinocchio's Jacobian of a chain's tip, along the axes of the chain's base, (6, n)."""
    data, locked = model.createData(), dict(chain.locked_at)
    q, places = in_pinocchio(model, (*chain.names, *locked), (*point, *locked.values()))
    frame = model.getFrameId(chain.tip)
    full = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    pin.updateFramePlacements(model, data)
    # The world of an MJCF file has another name there.
    base = model.getFrameId(chain.base) if model.existFrame(chain.base) else 0
    turn = data.oMf[base].rotation
    return np.kron(np.eye(2), turn.T) @ full[:, places[: len(chain.names)]]


@lru_cache
def real(name, task="all"):
    """The arm of the survey whose name begins so."""
    return next(one for one in ARMS if one.name.startswith(name) and one.task == task)


def pinocchio_model(declared):
    """An arm of the survey in pinocchio; skips what needs a package that tests do without."""
    try:
        path = str(declared.path)
    except MissingLibraryError as missing:
        if declared.package != "robosuite":
            raise
        pytest.skip(str(missing))
    read = pin.buildModelFromMJCF if path.endswith(".xml") else pin.buildModelFromUrdf
    return read(path)


def by_pinocchio(declared, configuration):
    """From a posture to ℓ and σ without any of our kinematics, scaling or measures."""
    model, chain = pinocchio_model(declared), declared.arm().chain
    assert chain.names == tuple(configuration)
    matrix = of_pinocchio(model, chain, configuration.values())
    slides = np.array(chain.prismatic)
    turning = matrix[:, ~slides]
    length = np.sqrt(np.sum(turning[:3] ** 2) / np.sum(turning[3:] ** 2))
    matrix[:3] /= length
    matrix[:, slides] *= length
    rows = matrix[:3] if declared.task == "position" else matrix
    return length, min(sigmas_left(rows))


def planar_sigmas(heading):
    """The worst case of planar arms of unit links, by their headings (N, n), in closed form."""
    arms = np.cumsum(np.exp(1j * heading)[:, ::-1], axis=1)[:, ::-1]  # from joint to tip
    columns = arms / np.sqrt(np.mean(np.abs(arms) ** 2, axis=1, keepdims=True))
    left = []
    for f in range(heading.shape[1]):
        kept = np.delete(columns, f, axis=1)
        # λ_min of a 2×2 Gram matrix of plane vectors z: (Σ|z|² − |Σz²|)/2
        left.append((np.sum(np.abs(kept) ** 2, axis=1) - np.abs(np.sum(kept**2, axis=1))) / 2)
    return np.sqrt(np.maximum(np.min(left, axis=0), 0.0)), arms[:, 0]


def sigmas_left(matrix):
    """The least singular value without each column, one after the other."""
    left = [np.delete(matrix, f, axis=1) for f in range(matrix.shape[1])]
    return np.array([np.linalg.svd(one, compute_uv=False)[-1] for one in left])


def random_revolute(seed, joints=7, levers=1.0):
    """Columns of revolute joints; lever arms of one length, or random ones."""
    rng = np.random.default_rng(seed)
    spin = rng.standard_normal((3, joints))
    spin /= np.linalg.norm(spin, axis=0)
    velocity = np.cross(spin, rng.standard_normal((3, joints)), axis=0)
    velocity *= levers / np.linalg.norm(velocity, axis=0)
    return np.vstack([velocity, spin])


def toolbox_robot(convention, rows):
    """An arm in roboticstoolbox, of rows (kind, d, a, alpha, theta); fixed ones turn, too."""
    import roboticstoolbox as rtb  # not earlier: seconds, for one file of tests

    revolute, prismatic = {
        "standard": (rtb.RevoluteDH, rtb.PrismaticDH),
        "modified": (rtb.RevoluteMDH, rtb.PrismaticMDH),
    }[convention]
    links = []
    for kind, d, a, alpha, theta in rows:
        slides = kind == "prismatic"
        given = {"theta": theta, "offset": d} if slides else {"d": d, "offset": theta}
        links.append((prismatic if slides else revolute)(a=a, alpha=alpha, **given))
    return rtb.DHRobot(links)


# An MJCF file of three joints; an equality has a place.
SMALL = """<mujoco><worldbody><body name="a"><joint name="a" axis="0 1 0" type="hinge"/>
<body name="b" pos="0 0 1"><joint name="b" axis="0 1 0"/><body name="c" pos="0 0 1">
<joint name="c" axis="0 1 0"/><body name="d" pos="0 0 1"/></body></body></body></worldbody>
<equality></equality></mujoco>"""
