"""An arm under its own dynamics in MuJoCo, and a failure that it notices and recovers from.

What comes in: an arm of seven joints, a path of its tool, samples of a trajectory along it, and
the joint that locks at a moment. What goes out: an `Episode`. It has five parts: the arm
follows the path; a joint locks; the arm notices, as the joint is not where it should be; it
brakes and stands; it follows the trajectory that `recover` finds, or stays where it is.

n is the number of joints, N that of simulated steps. Angles are in radians, lengths in metres.
"""

import re
import time
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery.failures import Locked
from lockedjoint.recovery.recover import recover
from lockedjoint.robot import Robot
from results.paths.paths import StudyPath
from results.robots.survey import SurveyArm

#: Seconds of a simulated step. Longer steps are less exact, shorter ones take longer.
STEP = 1e-3
# A joint has failed if it is farther than this from where it should be. Less than the errors of
# a healthy arm makes false alarms; more notices failures later.
_NOTICED_RAD = 0.005
# The stiffness of the controller, for each of the seven joints: stiffer ones err less.
_STIFFNESS_NM_PER_RAD = np.array([4000.0] * 4 + [1000.0] * 3)
# The damping of the controller, for each joint: with less of it the joints oscillate.
_DAMPING_NMS_PER_RAD = np.array([120.0] * 4 + [20.0] * 3)
# The inertia of each joint's rotor, which the file does not have.
_ROTOR_KGM2 = 0.1
# The factor by which links are heavier than the controller knows: errors grow with it.
_HEAVIER = 1.05
# The dry friction of each joint, which the controller does not know.
_FRICTION_NM = 0.3
# The time in which the arm brakes.
_BRAKES_S = 0.15
# The time for which it stands after that, and at the end.
_STANDS_S = 0.2
# The tool is back on the path if this is larger than its distance in metres plus 1 − |q·q₀| of
# its quaternion q and that of the path, q₀.
_BACK = 1e-4


class SimulatedArm:
    """An arm that follows motions of its joints until it notices that one does not.

    The controller feeds the torques of its own model forward, to which each joint adds what
    its own error of position and speed asks for. That error is all that it knows of a failure.
    """

    def __init__(self, arm: SurveyArm) -> None:
        self.believed, real = _specification(arm).compile(), _specification(arm)
        for body in real.bodies:
            body.mass, body.inertia = _HEAVIER * body.mass, _HEAVIER * body.inertia
        for joint in real.joints:
            joint.frictionloss = _FRICTION_NM
            lock = real.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, active=False)
            lock.name1, lock.solref = joint.name, [2 * STEP, 1.0]
        self.model = real.compile()
        self.data = mujoco.MjData(self.model)
        #: Where the joints were at every step so far: arrays of shape (n,), radians.
        self.joints: list[FloatArray] = []

    def follow(self, q: FloatArray, failure: tuple[int, int] | None = None) -> int | None:
        """Follow positions of every step, shape (N, n), and append to `joints` where they were.

        Failure is a joint, from 0, and the step at which it locks. If one is given, the motion
        ends when a joint is seen not to follow, and this joint is returned; else None.
        """
        speeds = np.gradient(q, STEP, axis=0)
        accelerations = np.gradient(speeds, STEP, axis=0)
        model, data, ahead = self.model, self.data, mujoco.MjData(self.believed)
        most = model.jnt_actfrcrange[:, 1]
        for k in range(len(q)):
            error = q[k] - data.qpos
            if failure is not None:
                joint, step = failure
                if k == step:
                    model.eq_data[joint, 0] = data.qpos[joint]
                    data.eq_active[joint] = True
                if np.max(np.abs(error)) > _NOTICED_RAD:
                    return int(np.argmax(np.abs(error)))
            ahead.qpos[:], ahead.qvel[:], ahead.qacc[:] = q[k], speeds[k], accelerations[k]
            mujoco.mj_inverse(self.believed, ahead)
            own = _STIFFNESS_NM_PER_RAD * error + _DAMPING_NMS_PER_RAD * (speeds[k] - data.qvel)
            data.qfrc_applied[:] = np.clip(ahead.qfrc_inverse + own, -most, most)
            mujoco.mj_step(model, data)
            self.joints.append(data.qpos.copy())
        return None


def _specification(arm: SurveyArm) -> mujoco.MjSpec:
    """Return the arm of a URDF file with its collision meshes, its fingers fixed."""
    text = re.sub(r"<visual>.*?</visual>|<mimic[^>]*>", "", arm.path.read_text(), flags=re.S)
    text = text.replace('type="prismatic"', 'type="fixed"')
    meshes = arm.path.parents[1] / "meshes" / "collision"
    whole = 'strippath="true" fusestatic="false" discardvisual="false"'
    settings = f'<mujoco><compiler meshdir="{meshes}" {whole}/></mujoco>'
    text = re.sub("(<robot[^>]*>)", rf"\1{settings}", text, count=1)
    made = mujoco.MjSpec.from_string(text)
    made.option.timestep = STEP
    for joint in made.joints:
        joint.armature = _ROTOR_KGM2
    sky, flat = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_FLAT
    made.add_texture(type=sky, builtin=flat, rgb1=[1, 1, 1], rgb2=[1, 1, 1], width=8, height=48)
    made.visual.headlight.ambient, made.visual.headlight.diffuse = [0.4] * 3, [0.6] * 3
    return made


class Ends(NamedTuple):
    """The steps, numbered from 0, at which the parts of an episode end."""

    fails: int  #: The joint locks.
    noticed: int  #: The arm notices it, or the episode ends unnoticed.
    stands: int  #: It has braked and stands.
    back: int  #: Its tool is back on the path; the same as `stands` if nothing was found.
    end: int  #: The episode ends: the number of all steps.


@dataclass(frozen=True, eq=False)
class Episode:
    """A failure as it was simulated.

    Attributes
    ----------
    verdict
        That of `recover`, or ``"unnoticed"``.
    recover_seconds
        Processor time of `recover`; NaN if it was not asked.
    ends
        When its parts end, in steps.
    joints
        Where the joints were at every step, shape (N, n), in radians.
    """

    verdict: str
    recover_seconds: float
    ends: Ends
    joints: FloatArray


def play(
    declared: StudyPath, seconds: float, samples: FloatArray, joint: int, moment: float
) -> Episode:
    """Run along a path in some seconds while a joint locks.

    Parameters
    ----------
    declared
        The path and its arm.
    seconds
        How long the whole path takes.
    samples
        Configurations at the K samples of the path that `ToolPath.sampled` gives, shape (K, n).
    joint
        The number of the joint that locks, from 0.
    moment
        When it locks, in seconds after the beginning.
    """
    (healthy, path), robot = declared.stated(), declared.robot
    times, poses, _ = path.sampled(len(samples), seconds)
    share = np.arange(0.0, seconds, STEP) / seconds
    clock = (
        seconds * share**3 * (10 - 15 * share + 6 * share**2)
    )  # from rest to rest, of degree 5
    planned = CubicSpline(times, samples)(clock)
    arm, fails = SimulatedArm(robot), round(moment / STEP)
    arm.data.qpos[:] = planned[0]
    found = arm.follow(planned, (joint, fails))
    noticed = len(arm.joints)
    if found is None:
        return Episode("unnoticed", np.nan, Ends(fails, *[noticed] * 4), np.array(arm.joints))
    # The arm brakes evenly: after t seconds it has moved by speed·(t − t²/(2 T)), t ≤ T.
    speed = (planned[noticed] - planned[noticed - 1]) / STEP
    brakes = np.minimum(np.arange(0.0, _BRAKES_S + _STANDS_S, STEP), _BRAKES_S)[:, None]
    standing = planned[noticed] + speed * (brakes - brakes**2 / (2 * _BRAKES_S))
    standing[:, found] = arm.data.qpos[found]
    arm.follow(standing)
    stands = back = len(arm.joints)
    standing[-1, found] = arm.data.qpos[found]
    start = np.clip(standing[-1], *healthy.chain.limits)
    # The rest of the path begins at the last sample that was passed: nothing is left out.
    passed = int(np.searchsorted(times, clock[noticed])) - 1
    turns = Rotation.from_matrix(poses.rotations[passed:]).as_quat()
    rest, began = ToolPath(poses.positions[passed:], turns), time.process_time()
    failure = Locked(healthy.chain.names[found], float(start[found]))
    answer = recover(Robot(robot.path, tip=robot.tip), start, failure, rest)
    took, run = time.process_time() - began, answer.trajectory
    if run is not None:
        off = np.linalg.norm(run.tool[:, :3] - rest.positions[0], axis=1)
        off += 1 - np.abs(run.tool[:, 3:] @ turns[0])
        back += round(float(run.times[np.argmax(off < _BACK)]) / STEP)
        grid = np.arange(0.0, run.duration + _STANDS_S, STEP)
        arm.follow(CubicSpline(run.times, run.positions)(np.minimum(grid, run.duration)))
    ends = Ends(fails, noticed, stands, back, len(arm.joints))
    return Episode(answer.verdict, took, ends, np.array(arm.joints))
