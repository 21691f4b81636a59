"""The normal form of a chain: every motion is about or along z.

Frames are those of Denavit and Hartenberg. The form is computed once for each chain, and is
what moves it in NumPy. Configurations come last: B of n joints are q, (n, B), in radians or
metres; columns (v; ω) of the k motions have shape (rows, k, B), in metres and radians along the
axes of the base. One operation then does as much work as it can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, crosses, homogeneous
from lockedjoint.kinematics.motion import Motion, Transform
from lockedjoint.nlp.arrays import FloatArray

# Axes are parallel, but for rounding, if the sine of the angle between them is at most this. If
# it is larger, axes that are nearly parallel are made parallel, and the tip is elsewhere.
_PARALLEL_SINE = 1e-15
# A unit vector is along z if its last entry is less than this away from 1 or -1: the x axis is
# then across it, and no cross product of length 0 is divided by.
_ALONG_Z_SHORTFALL = 1e-12


@dataclass(frozen=True)
class Offset:
    """What is between two motions: a shift along x, y and z, then a turn about x."""

    shift: list[float]  #: Three lengths in metres.
    cosine: float  #: Of the angle about x.
    sine: float  #: It is at least 0: the angle is from 0 to π.


@dataclass(frozen=True, eq=False)
class NormalForm:
    """k motions about or along z, and what is between them."""

    variables: list[int]  #: The joint that drives each motion, by number.
    multipliers: FloatArray  #: Factors of that joint's position, shape (k, 1).
    offsets: FloatArray  #: Offsets are added to that, radians or metres, shape (k, 1).
    slides: BoolArray  #: True for motions along z, shape (k, 1).
    links: list[Offset]  #: The link before each motion.
    turns: FloatArray  #: Turns are added to the angle about z, radians, (k, 1).
    outset: FloatArray  #: Orientation before the first motion, shape (3, 3).
    end: FloatArray  #: The tip's point in the frame after the last motion, 4×4.

    @classmethod
    def of(cls, motions: Sequence[Motion], end: Transform) -> NormalForm:
        """Return the normal form of a chain's motions from base to tip.

        A placement is a shift, and turns about z, x and z: only that about x is left between
        two motions; the others are part of the angles before and after. A turn about z and a
        motion along or about z may change places.
        """
        links, turns = [], np.zeros((len(motions), 1))
        outset, carried = np.eye(3), np.eye(4)
        for k, motion in enumerate(motions):
            # With the rotation pose[:3, :3] = Rz(θ) Rx(α) Rz(φ), its last column is
            # (sin θ sin α, -cos θ sin α, cos α); φ remains in Rx(α) Rz(φ), the rest.
            to_axis = homogeneous(turn_to(np.array(motion.axis)))
            pose = carried @ np.array(motion.placement) @ to_axis
            cosine, sine = pose[2, 2], float(np.hypot(*pose[:2, 2]))
            theta = np.arctan2(pose[0, 2], -pose[1, 2]) if sine > _PARALLEL_SINE else 0.0
            if sine <= _PARALLEL_SINE:
                cosine, sine = np.sign(cosine), 0.0
            cos, sin = np.cos(theta), np.sin(theta)
            back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            if k:
                turns[k - 1] += theta
            else:
                outset = back.T
            rest = back @ pose[:3, :3]
            turns[k] = np.arctan2(-rest[0, 1], rest[0, 0])
            links.append(Offset((back @ pose[:3, 3]).tolist(), float(cosine), float(sine)))
            carried = to_axis.T
        return cls(
            variables=[motion.variable for motion in motions],
            multipliers=np.array([[motion.multiplier] for motion in motions]),
            offsets=np.array([[motion.offset] for motion in motions]),
            slides=np.array([[motion.prismatic] for motion in motions]),
            links=links,
            turns=turns,
            outset=outset,
            end=carried @ np.array(end),
        )

    @property
    def reach(self) -> float:
        """A bound of the tip's distance from any joint's axis, but for travels, in metres."""
        shifts = [np.linalg.norm(link.shift) for link in self.links[1:]]
        return float(np.sum(shifts) + np.linalg.norm(self.end[:3, 3]))

    def frames(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return where the motions' axes and the tip are, see `Chain.frames`."""
        values = self.multipliers * q[self.variables] + self.offsets
        angles = np.where(self.slides, 0.0, values) + self.turns
        # One tangent takes half as long as a cosine and a sine: with t = tan(φ/2),
        # cos φ = 2/(1 + t²) - 1 and sin φ = 2t/(1 + t²).
        tangents = np.tan(angles / 2)
        factors = 2 / (1 + tangents**2)
        cosines, sines = factors - 1, factors * tangents
        x, y, z = np.repeat(self.outset.T[:, :, None], q.shape[1], axis=2)
        position = np.zeros((3, q.shape[1]))
        axes, origins = np.empty((2, len(values), 3, q.shape[1]))
        # The axes x, y, z of the present frame and its origin, the position, are (3, B) each.
        for k, link in enumerate(self.links):
            for length, axis in zip(link.shift, (x, y, z), strict=True):
                if length:
                    position = position + length * axis
            if abs(link.cosine) <= _PARALLEL_SINE:
                y, z = (z, -y) if link.sine > 0 else (-z, y)
            elif link.sine:
                y, z = link.cosine * y + link.sine * z, link.cosine * z - link.sine * y
            elif link.cosine < 0:
                y, z = -y, -z
            origins[k], axes[k] = position, z
            if self.slides[k]:
                position = position + values[k] * z
            cos, sin = cosines[k], sines[k]
            x, y = cos * x + sin * y, cos * y - sin * x
        orientation = np.stack([x, y, z], axis=1)
        position = position + np.matmul(self.end[:3, 3], orientation)
        return axes, origins, position, np.matmul(self.end[:3, :3].T, orientation)

    def columns(
        self, axes: FloatArray, origins: FloatArray, position: FloatArray, rows: int
    ) -> FloatArray:
        """Return v, or (v; ω), of the tip for each of the motions, (3 or 6 rows, k, B)."""
        columns = np.zeros((rows, len(axes), axes.shape[2]))
        columns[:3] = crosses(axes, position - origins).swapaxes(0, 1)
        axes = axes.swapaxes(0, 1)
        if rows > 3:
            columns[3:] = axes
        slides = self.slides[:, 0]
        if slides.any():
            columns[:3, slides], columns[3:, slides] = axes[:, slides], 0.0
        return columns

    def by_joint(self, columns: FloatArray, size: int) -> FloatArray:
        """Return the sums of the motions' columns, (rows, k, B), by joint, (rows, n, B)."""
        if self.variables == list(range(size)) and np.all(self.multipliers == 1):
            return columns
        matrix = np.zeros((len(columns), size, columns.shape[2]))
        for k, variable in enumerate(self.variables):
            matrix[:, variable] += self.multipliers[k, 0] * columns[:, k]
        return matrix


def turn_to(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes the z axis to a unit vector, (3, 3)."""
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, x) if abs(axis[2]) < 1 - _ALONG_Z_SHORTFALL else np.array([1.0, 0, 0])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
