"""A joint without torque and brake: where it hangs, and what would hold it elsewhere.

Pinocchio has the masses and computes torques. Whatever the robot, the torque that holds one
revolute joint against gravity is τ = A sin(q - q*) while all others stand: q* is its only
stable equilibrium. So A and q - q* follow from τ and its slope ∂τ/∂q = A cos(q - q*).

q       positions of the chain's n joints, radians or metres, shape (n,) or (n, B) for B.
q*      where the joint hangs while the others stand, radians: it depends on them.
A       gravity's largest moment about the joint, N m, above 0.
Rates are per second and per second squared, shape (n,). Names of methods and fields are also
used by `lockedjoint.recovery`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.description import Description
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# Gravity's moment is evaluated at so many random configurations: with fewer, a joint may be
# taken for balanced that is not.
_DRAWN_CONFIGURATIONS = 50
# A moment below this counts as zero: a joint that has no larger one is refused.
_SMALLEST_MOMENT_NM = 1e-6


@dataclass(frozen=True, eq=False)
class HangingJoint:
    """A revolute joint of a chain that nothing but gravity moves, along -z of the root."""

    name: str
    own: int  #: Its place among the chain's joints.
    model: Any  #: The `pinocchio.Model`.
    data: Any  #: The `pinocchio.Data` of that model, which each computation overwrites.
    still: FloatArray  #: Pinocchio's configuration, in which the chain's joints are at 0.
    #: Arrays of shape (n,) say where the chain's joints begin in it, which of them have a
    #: cosine and a sine there, and which places they have among the velocities.
    places: IntArray
    circles: BoolArray
    columns: IntArray

    @classmethod
    def of(cls, robot: Description, chain: Chain, name: str) -> HangingJoint:
        """Return a joint of a chain of a robot that was read from URDF or a pinocchio model.

        Raises
        ------
        InputError
            If the robot has no masses, the joint none beyond it, or gravity no moment about it.
        MissingLibraryError
            If pinocchio is not installed.
        """
        own = chain.names.index(name)
        simple = [(m.variable, m.multiplier, m.offset) for m in chain.motions]
        if chain.joints[own].prismatic or simple != [(k, 1, 0) for k in range(len(simple))]:
            allowed = "a revolute joint of an arm in which no joint follows another"
            raise InputError("joint that swings freely", name, allowed)
        model = _model(robot, name)
        data = model.createData()
        import pinocchio as pin

        pin.computeSubtreeMasses(model, data)
        if not data.mass[model.getJointId(name)] > 0:
            allowed = "one beyond which links have masses in the file"
            raise InputError("joint that swings freely", f"{name}, which bears none", allowed)
        joints = [model.joints[model.getJointId(each)] for each in chain.names]
        places, sizes, columns = np.array([(j.idx_q, j.nq, j.idx_v) for j in joints]).T
        still = _still(model, dict((*chain.immobile, *chain.locked_at)))
        joint = cls(name, own, model, data, still, places, sizes == 2, columns)
        lower, upper = (np.clip(side, -np.pi, np.pi) for side in chain.limits)
        drawn = np.random.default_rng(0).uniform(
            lower, upper, (_DRAWN_CONFIGURATIONS, len(lower))
        )
        if max(joint.moment(q) for q in drawn) < _SMALLEST_MOMENT_NM:
            allowed = "one about which gravity has a moment"
            raise InputError("joint that swings freely", f"{name}, which is balanced", allowed)
        return joint

    def off(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far beyond q* configurations (n, B) are, (B,), and its slopes, (n, B).

        The angle q - q* is in radians, between -π and π. The slopes ∂(q - q*)/∂q hold where it
        hangs: there they are ∂τ/∂q over A, and 1 for the joint itself.
        """
        torques = [self._gravity(each) for each in q.T]
        torque, slopes = (np.array(part) for part in zip(*torques, strict=True))
        size = np.maximum(np.hypot(torque, slopes[:, self.own]), _SMALLEST_MOMENT_NM)
        angle, slopes = np.arctan2(torque, slopes[:, self.own]), slopes / size[:, None]
        slopes[:, self.own] = 1.0
        return angle, slopes.T

    def moment(self, q: FloatArray) -> float:
        """Return A at a configuration (n,), in N m."""
        torque, slopes = self._gravity(q)
        return float(np.hypot(torque, slopes[self.own]))

    def hung(self, q: FloatArray) -> FloatArray:
        """Return q, (n,), with the joint where it hangs, at most half a turn away."""
        q = q.copy()
        q[self.own] -= self.off(q[:, None])[0][0]
        return q

    def lag(self, q: FloatArray, speed: FloatArray, acceleration: FloatArray) -> float:
        """Return by what angle in radians inertia holds the joint off q*: |τ|/A if it is small.

        With the joint at q* in q, τ is the torque that this motion would need there.
        """
        return abs(self._torque(q, speed, acceleration)) / max(
            self.moment(q), _SMALLEST_MOMENT_NM
        )

    def falls(self, q: FloatArray, speed: FloatArray, acceleration: FloatArray) -> float:
        """Return the joint's acceleration without friction and torque, the others' given.

        A torque τ would make the accelerations those given, (n,); without it the joint's is
        less by τ/I, where I is the diagonal entry of the mass matrix. All is in rad/s².
        """
        import pinocchio as pin

        column = self.columns[self.own]
        inertia = pin.crba(self.model, self.data, self._placed(q))[column, column]
        return float(acceleration[self.own] - self._torque(q, speed, acceleration) / inertia)

    def _torque(self, q: FloatArray, *rates: FloatArray) -> float:
        """Return the joint's torque in N m, from q, speed and acceleration, (n,) each."""
        import pinocchio as pin

        whole = np.zeros((2, self.model.nv))
        whole[:, self.columns] = rates
        torques = pin.rnea(self.model, self.data, self._placed(q), *whole)
        return float(torques[self.columns[self.own]])

    def _gravity(self, q: FloatArray) -> tuple[float, FloatArray]:
        """Return τ, the torque that holds the joint against gravity, and ∂τ/∂q, shape (n,)."""
        import pinocchio as pin

        at, own = (self.model, self.data, self._placed(q)), self.columns[self.own]
        slopes = pin.computeGeneralizedGravityDerivatives(*at)[own, self.columns]
        return pin.computeGeneralizedGravity(*at)[own], slopes

    def _placed(self, q: FloatArray) -> FloatArray:
        """Return pinocchio's configuration, shape (nq,), of q, shape (n,)."""
        placed = self.still.copy()
        placed[self.places] = np.where(self.circles, np.cos(q), q)
        placed[self.places[self.circles] + 1] = np.sin(q[self.circles])
        return placed


def _still(model: Any, known: Mapping[str, float]) -> FloatArray:
    """Return pinocchio's configuration, (nq,): some joints are known, others near 0."""
    import pinocchio as pin

    placed = pin.neutral(model)
    for joint, name in list(zip(model.joints, model.names, strict=True))[1:]:
        k = joint.idx_q
        if joint.nq == 2 and name in known:
            placed[k : k + 2] = np.cos(known[name]), np.sin(known[name])
        elif joint.nq == 1:
            nearest = np.clip(0.0, model.lowerPositionLimit[k], model.upperPositionLimit[k])
            placed[k] = known.get(name, float(nearest))
    return np.asarray(placed)


def _model(robot: Description, name: str) -> Any:
    """Return pinocchio's model; InputError if it is none, or its file has no masses."""
    pin = library("pinocchio", package="pin")
    model = getattr(robot.model, "model", robot.model)  # of a RobotWrapper
    if isinstance(model, pin.Model):
        return model
    if not robot.is_urdf:
        allowed = "one of a URDF file or a pinocchio model: nothing else has masses here"
        raise InputError("joint that swings freely", name, allowed)
    try:
        return pin.buildModelFromXML(robot.text.decode("utf-8-sig"))
    except ValueError as error:
        reason = str(error).strip().partition("\n")[0]
        allowed = f"a file that pinocchio reads ({reason})"
        raise InputError("robot", f"{robot.file}", allowed) from None
