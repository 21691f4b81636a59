"""Where the bodies of a robot are, at many configurations at once, in numbers.

Letters: n joints, B configurations as columns, shape (n, B), radians or (prismatic joints)
metres. A *body* is what a joint moves; body 0 is the base and does not move. Origins are in
metres. `kinematics.forward.body_frames` has the same for one symbolic configuration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.motion import Bodies, Motion
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BodyPlacement:
    """A body's joint in the frame of the body before it.

    By Rodrigues' formula a turn by θ about the axis a is I + sin θ S + (1 − cos θ) S², where S
    is the matrix of the cross product with a. So the body's rotation has three parts, and one
    product with the parent's rotation turns all of them.
    """

    parent: int  #: Number of the body before.
    motion: Motion  #: How the joint moves, and which variable drives it.
    #: R, RS and RS² for the rotation R at 0, transposed and stacked, shape (9, 3): `np.matmul`
    #: then multiplies them from the right to a parent's rotation, shape (3, 3, B).
    parts: FloatArray
    shift: FloatArray  #: Origin at 0, shape (3,), metres.
    axis: FloatArray  #: Unit vector of the joint's axis, shape (3,).


def body_placements(bodies: Bodies) -> list[BodyPlacement]:
    """Return what `placed_frames` needs of each body 1, 2, …, in the order of the bodies."""
    placements = []
    for parent, motion in bodies:
        pose, axis = np.array(motion.placement), np.array(motion.axis)
        skew = np.cross(np.eye(3), axis)
        turned = (pose[:3, :3], pose[:3, :3] @ skew, pose[:3, :3] @ skew @ skew)
        parts = np.concatenate([part.T for part in turned])
        shift, along = pose[:3, 3], pose[:3, :3] @ axis
        placements.append(BodyPlacement(parent, motion, parts, shift, along))
    return placements


def placed_frames(
    placements: Sequence[BodyPlacement], configurations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the frames of all bodies at configurations (n, B), from the base.

    Returns
    -------
    numpy.ndarray
        Rotations from the body's to the base's axes, shape (bodies + 1, 3, 3, B): axis j of
        body k has the coordinates [k, :, j] in the base.
    numpy.ndarray
        Origins, shape (bodies + 1, 3, B), metres.
    """
    q = configurations
    rotations = np.empty((len(placements) + 1, 3, 3, q.shape[1]))
    origins = np.zeros((len(placements) + 1, 3, q.shape[1]))
    rotations[0] = np.eye(3)[:, :, None]
    for k, place in enumerate(placements, 1):
        parent, motion = place.parent, place.motion
        value = motion.multiplier * q[motion.variable] + motion.offset
        parts = np.matmul(place.parts, rotations[parent])
        rotations[k] = parts[:, :3]
        origins[k] = origins[parent] + np.matmul(place.shift, rotations[parent])
        if motion.prismatic:
            origins[k] += value * np.matmul(place.axis, rotations[parent])
        else:
            rotations[k] += np.sin(value) * parts[:, 3:6]
            rotations[k] += (1 - np.cos(value)) * parts[:, 6:]
    return rotations, origins
