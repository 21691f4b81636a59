"""Serial chains in one form: each joint acts on the z axis of its own frame.

Joints are independent, motion k is that of joint k, and limits are finite: of a joint that
makes a full turn they are −π and π. Workspaces are measured and proved in this form.

A chain has n joints, and here n motions. Lengths are metres, angles radians; a frame or a
placement is a homogeneous 4×4 matrix, the pose of one frame in the one before it. Functions
with a cache return arrays that cannot be written to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lockedjoint.kinematics.chain import Chain, ChainJoint
from lockedjoint.kinematics.geometry import homogeneous
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.kinematics.motion import Motion, frozen
from lockedjoint.kinematics.normal_form import turn_to
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

Bits = npt.NDArray[np.bool_]
#: Ranges are the lower and upper limit of each joint, in radians or metres.
Ranges = tuple[tuple[float, float], ...]
# A turn has this angle.
_TURN_RAD = 2 * np.pi
# Joints move about the z axis of their frames, or along it.
_Z = (0.0, 0.0, 1.0)
# Links, distances from an axis and sines of angles between axes count as zero below this. If it
# is larger, arms that are nearly planar count as planar, and the sizes of workspaces change.
_TINY_M = 1e-6
# A range that is less than a turn by no more than this is a turn: rounding.
_TURN_ROUNDING_RAD = 1e-9
# The results of the functions below are kept for so many chains.
_CACHED_CHAINS = 64


def serial_chain(chain: Chain) -> Chain:
    """Return a chain in this form.

    InputError if a joint moves others with it, or a prismatic joint has no limits.
    """
    drivers = [motion.variable for motion in chain.motions]
    if drivers != list(range(len(chain.joints))):
        raise InputError("joints", "coupled by mimicry", "a chain of independent joints")
    before = np.eye(4)
    joints, frames = [], []
    for motion, joint in zip(chain.motions, chain.joints, strict=True):
        if motion.multiplier != 1 or motion.offset != 0:
            allowed = "a joint that follows no other one"
            raise InputError(f"joint {joint.name}", "a mimic joint", allowed)
        low, high = joint.lower, joint.upper
        if joint.prismatic and not np.isfinite(high - low):
            raise InputError(f"joint {joint.name}", "a slider without limits", "finite limits")
        if not joint.prismatic and not high - low < _TURN_RAD:
            low, high = -np.pi, np.pi
        joints.append(ChainJoint(joint.name, motion.prismatic, low, high))
        orientation = homogeneous(turn_to(np.array(motion.axis)))
        frames.append(before @ np.array(motion.placement) @ orientation)
        before = orientation.T
    made = chain_about_z(joints, frames, before @ np.array(chain.end))
    return replace(made, robot=chain.robot, base=chain.base, tip=chain.tip)


def chain_about_z(
    joints: Sequence[ChainJoint], frames: Sequence[FloatArray], end: FloatArray
) -> Chain:
    """Return a chain of joints, from where each one's frame is in that of the one before.

    Frames are 4×4, and the end is the tip's pose in the last one.
    """
    motions = (
        Motion(frozen(frame), _Z, joint.prismatic, k, 1.0, 0.0)
        for k, (joint, frame) in enumerate(zip(joints, frames, strict=True))
    )
    return Chain("arm", "base", "tip", tuple(joints), tuple(motions), frozen(end))


def planar_chain(lengths: Sequence[float]) -> Chain:
    """Return a planar arm of revolute joints without limits, from the lengths of its links."""
    *frames, end = (homogeneous(np.eye(3), [length, 0.0, 0.0]) for length in (0.0, *lengths))
    joints = [
        ChainJoint(f"joint_{k}", False, -np.pi, np.pi) for k in range(1, len(lengths) + 1)
    ]
    return chain_about_z(joints, frames, end)


@lru_cache(maxsize=_CACHED_CHAINS)
def frames_of(chain: Chain) -> FloatArray:
    """Return where each joint's frame is in that of the one before, shape (n, 4, 4)."""
    frames = np.array([motion.placement for motion in chain.motions])
    frames.flags.writeable = False
    return frames


def tip_of(chain: Chain) -> FloatArray:
    """Return the tip's point in the last joint's frame, shape (3,)."""
    return np.array(chain.end)[:3, 3]


def physical_ranges(chain: Chain) -> Ranges:
    """Return the lower and upper limit of every joint."""
    return tuple((joint.lower, joint.upper) for joint in chain.joints)


@lru_cache(maxsize=_CACHED_CHAINS)
def is_planar(chain: Chain) -> bool:
    """Whether all axes are parallel revolute ones, so that the tip moves in a plane."""
    # The first two entries of a frame's z axis are the sine of its angle to the one before.
    parallel = all(np.hypot(*frame[:2, 2]) < _TINY_M for frame in frames_of(chain)[1:])
    return parallel and not any(chain.prismatic)


@lru_cache(maxsize=_CACHED_CHAINS)
def idle_joints(chain: Chain) -> tuple[bool, ...]:
    """Which joints cannot move the tip: those at the end whose axis it is on."""
    idle, point = [False] * len(chain.joints), tip_of(chain)
    for k, joint in reversed(list(enumerate(chain.joints))):
        if joint.prismatic or np.hypot(*point[:2]) >= _TINY_M:
            break
        idle[k], point = True, moved(frames_of(chain)[k], point)
    return tuple(idle)


def link_lengths(chain: Chain) -> FloatArray:
    """Return how long the link after each joint is, shape (n,): to the next one's frame."""
    shifts = [*frames_of(chain)[1:, :3, 3], tip_of(chain)]
    return np.array([np.linalg.norm(shift) for shift in shifts])


def with_links(chain: Chain, lengths: Sequence[float] | FloatArray) -> Chain:
    """Return the chain with its links scaled to other lengths, n of them; zero ones stay."""
    old = link_lengths(chain)
    factors = [
        new / length if length > _TINY_M else 1.0
        for new, length in zip(lengths, old, strict=True)
    ]
    frames, end = frames_of(chain).copy(), np.array(chain.end)
    frames[1:, :3, 3] *= np.array(factors[:-1])[:, None]
    end[:3, 3] *= factors[-1]
    return chain_about_z(chain.joints, list(frames), end)


@lru_cache(maxsize=_CACHED_CHAINS)
def from_first_joint(chain: Chain) -> Chain:
    """Return the chain as seen from the frame of joint 1."""
    return chain_about_z(chain.joints, [np.eye(4), *frames_of(chain)[1:]], np.array(chain.end))


@lru_cache(maxsize=_CACHED_CHAINS)
def at_zero(chain: Chain) -> JointAxes:
    """Return the axes at q = 0 in the frame of joint 1, one in front."""
    start = np.zeros((len(chain.joints), 1))
    axes, origins, tip, _ = from_first_joint(chain).frames(start)
    prismatic = np.array([chain.prismatic])
    parts = (axes[None, ..., 0], origins[None, ..., 0], prismatic, tip[:, 0])
    for part in parts:
        part.flags.writeable = False
    return JointAxes(*parts)


def opened(chain: Chain, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return limits (…, n), infinite where a joint makes a full turn."""
    continuous = np.array([joint.continuous for joint in chain.joints])
    full = continuous & (upper - lower >= _TURN_RAD - _TURN_ROUNDING_RAD)
    return np.where(full, -np.inf, lower), np.where(full, np.inf, upper)


def moved(placement: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (k, 3) in the frame that a placement, 4×4, is relative to."""
    return np.asarray(points @ placement[:3, :3].T + placement[:3, 3])


def moved_back(placement: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (k, 3) in the frame that a placement, 4×4, is of."""
    return np.asarray((points - placement[:3, 3]) @ placement[:3, :3])
