"""A serial arm in one form: every joint acts on the z axis of its frame; many q at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lockedjoint.kinematics.chain import Chain, ChainJoint
from lockedjoint.kinematics.link_chain import LinkChain, homogeneous
from lockedjoint.kinematics.motion import Motion, frozen
from lockedjoint.kinematics.normal_form import turn_to
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

Bits = npt.NDArray[np.bool_]
#: Lower and upper limit of each joint, in radians or metres.
Ranges = tuple[tuple[float, float], ...]
_TURN = 2 * np.pi
_Z = (0.0, 0.0, 1.0)
# Links and distances from an axis below this are none, in metres.
_TINY = 1e-6


@dataclass(frozen=True, eq=False)
class Step(ChainJoint):
    """A joint, and its placement A in the frame of the previous one.

    It turns about, or moves along, the z axis of its frame.
    """

    placement: FloatArray = field(default_factory=lambda: np.eye(4))

    @property
    def continuous(self) -> bool:
        """Whether it can make a full turn, so that its angles have no ends."""
        return not self.prismatic and self.upper - self.lower >= _TURN - 1e-9


@dataclass(frozen=True, eq=False)
class SerialArm:
    """Joints from base to tip, and the tip's point and orientation in the frame of the last."""

    steps: tuple[Step, ...]
    tip: FloatArray
    tip_orientation: FloatArray = field(default_factory=lambda: np.eye(3))

    @classmethod
    def from_chain(cls, chain: Chain) -> SerialArm:
        """Return the arm of a chain.

        InputError if a joint moves others with it, or a prismatic joint has no limits.
        """
        drivers = [motion.variable for motion in chain.motions]
        if drivers != list(range(len(chain.joints))):
            raise InputError("joints", "coupled by mimicry", "a chain of independent joints")
        before = np.eye(4)
        steps = []
        for motion, joint in zip(chain.motions, chain.joints, strict=True):
            if motion.multiplier != 1 or motion.offset != 0:
                allowed = "a joint that follows no other one"
                raise InputError(f"joint {joint.name}", "a mimic joint", allowed)
            orientation = homogeneous(turn_to(np.array(motion.axis)))
            low, high = joint.lower, joint.upper
            if joint.prismatic and not np.isfinite(high - low):
                allowed = "finite limits"
                raise InputError(f"joint {joint.name}", "a slider without limits", allowed)
            if not joint.prismatic and not high - low < _TURN:
                low, high = -np.pi, np.pi
            placement = before @ np.array(motion.placement) @ orientation
            steps.append(Step(joint.name, motion.prismatic, low, high, placement=placement))
            before = orientation.T
        end = before @ np.array(chain.end)
        return cls(tuple(steps), end[:3, 3], end[:3, :3])

    @classmethod
    def planar(cls, lengths: Sequence[float]) -> SerialArm:
        """Return a planar arm of revolute joints without limits."""
        *shifts, tip = (np.array([length, 0.0, 0.0]) for length in (0.0, *lengths))
        steps = (
            Step(f"joint_{k}", False, -np.pi, np.pi, placement=homogeneous(np.eye(3), shift))
            for k, shift in enumerate(shifts, 1)
        )
        return cls(tuple(steps), tip)

    @property
    def physical(self) -> Ranges:
        """Physical limits of every joint."""
        return tuple((step.lower, step.upper) for step in self.steps)

    @cached_property
    def is_planar(self) -> bool:
        """Whether all axes are parallel revolute ones, so that the tip moves in a plane."""
        parallel = all(np.hypot(*step.placement[:2, 2]) < _TINY for step in self.steps[1:])
        return parallel and not any(step.prismatic for step in self.steps)

    @cached_property
    def idle(self) -> tuple[bool, ...]:
        """Which joints cannot move the tip: those at the end whose axis it is on."""
        idle, point = [False] * len(self.steps), self.tip
        for k, step in reversed(list(enumerate(self.steps))):
            if step.prismatic or np.hypot(*point[:2]) >= _TINY:
                break
            idle[k], point = True, moved(step.placement, point)
        return tuple(idle)

    @cached_property
    def links(self) -> FloatArray:
        """Lengths of the links after each joint: the translations of the placements."""
        offsets = [step.placement[:3, 3] for step in self.steps[1:]]
        return np.array([np.linalg.norm(offset) for offset in (*offsets, self.tip)])

    def with_links(self, lengths: Sequence[float] | FloatArray) -> SerialArm:
        """Return the arm with its links scaled to other lengths."""
        old = self.links
        factors = [
            new / length if length > _TINY else 1.0
            for new, length in zip(lengths, old, strict=True)
        ]
        steps = [self.steps[0]]
        for step, factor in zip(self.steps[1:], factors, strict=False):
            placement = step.placement.copy()
            placement[:3, 3] *= factor
            steps.append(replace(step, placement=placement))
        return SerialArm(tuple(steps), self.tip * factors[-1], self.tip_orientation)

    @cached_property
    def chain(self) -> Chain:
        """The joints and the tip's position in the frame of joint 1."""
        motions = []
        for k, step in enumerate(self.steps):
            placement = step.placement if k else np.eye(4)
            motions.append(Motion(frozen(placement), _Z, step.prismatic, k, 1.0, 0.0))
        end = frozen(homogeneous(self.tip_orientation, self.tip))
        return Chain("arm", "base", "tip", self.steps, tuple(motions), end)

    @cached_property
    def orientation(self) -> FloatArray:
        """Orientation of the tip at q = 0 in the frame of joint 1, shape (3, 3)."""
        return self.chain.frames(np.zeros((len(self.steps), 1)))[3][..., 0]

    @cached_property
    def at_zero(self) -> LinkChain:
        """The arm at q = 0 in the frame of joint 1, one in front."""
        axes, origins, tip, _ = self.chain.frames(np.zeros((len(self.steps), 1)))
        prismatic = np.array([[step.prismatic for step in self.steps]])
        return LinkChain(axes[None, ..., 0], origins[None, ..., 0], prismatic, tip[:, 0])

    def opened(self, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return limits (…, n) without ends where a joint makes a full turn."""
        continuous = np.array([step.continuous for step in self.steps])
        full = continuous & (upper - lower >= _TURN - 1e-9)
        return np.where(full, -np.inf, lower), np.where(full, np.inf, upper)


def moved(placement: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (k, 3) in the frame that a placement, 4×4, is relative to."""
    return np.asarray(points @ placement[:3, :3].T + placement[:3, 3])


def moved_back(placement: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (k, 3) in the frame that a placement, 4×4, is of."""
    return np.asarray((points - placement[:3, 3]) @ placement[:3, :3])
