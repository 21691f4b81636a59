"""An arm under its own dynamics in MuJoCo, and a failure that it notices and recovers from."""

import re
import time
from dataclasses import dataclass

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

#: Seconds of a step.
STEP = 1e-3
# A joint has failed that is so far from where it should be, radians.
_NOTICED = 0.005
# Of the controller, for each joint: N m/rad and N m s/rad.
_STIFFNESS = np.array([4000.0] * 4 + [1000.0] * 3)
_DAMPING = np.array([120.0] * 4 + [20.0] * 3)
# The rotors' inertia, kg m², which the file does not have.
_ROTORS = 0.1
# What the controller does not know: how much heavier links are, and dry friction, N m.
_HEAVIER, _FRICTION = 1.05, 0.3
# Seconds in which the arm brakes, and for which it stands then.
_BRAKES, _STANDS = 0.15, 0.2
# The tool is back on the path this nearly: metres, and a part of a quaternion.
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
            joint.frictionloss = _FRICTION
            lock = real.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, active=False)
            lock.name1, lock.solref = joint.name, [2 * STEP, 1.0]
        self.model = real.compile()
        self.data = mujoco.MjData(self.model)
        #: Where the joints were at every step.
        self.joints: list[FloatArray] = []

    def follow(self, q: FloatArray, failure: tuple[int, int] | None = None) -> int | None:
        """Follow positions of every step, shape (N, n).

        At the step `failure[1]` the joint `failure[0]` locks, and the motion ends when a joint
        is seen not to follow, which is returned.
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
                if np.max(np.abs(error)) > _NOTICED:
                    return int(np.argmax(np.abs(error)))
            ahead.qpos[:], ahead.qvel[:], ahead.qacc[:] = q[k], speeds[k], accelerations[k]
            mujoco.mj_inverse(self.believed, ahead)
            own = _STIFFNESS * error + _DAMPING * (speeds[k] - data.qvel)
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
        joint.armature = _ROTORS
    sky, flat = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_FLAT
    made.add_texture(type=sky, builtin=flat, rgb1=[1, 1, 1], rgb2=[1, 1, 1], width=8, height=48)
    made.visual.headlight.ambient, made.visual.headlight.diffuse = [0.4] * 3, [0.6] * 3
    return made


@dataclass(frozen=True, eq=False)
class Episode:
    """A failure as it was simulated: `joints` are positions at every step, shape (N, n).

    At the steps `ends` the joint locks, this is noticed, the arm stands, is back on the path,
    and ends. The verdict is that of `recover`, which took so many seconds of the processor,
    or ``"unnoticed"``.
    """

    verdict: str
    recover_seconds: float
    ends: tuple[int, ...]
    joints: FloatArray


def play(
    declared: StudyPath, seconds: float, samples: FloatArray, joint: int, moment: float
) -> Episode:
    """Run along a path in some seconds, through samples (N, n), while a joint locks."""
    (healthy, path), robot = declared.stated(), declared.robot
    times, poses, _ = path.sampled(len(samples), seconds)
    share = np.arange(0.0, seconds, STEP) / seconds
    clock = seconds * share**3 * (10 - 15 * share + 6 * share**2)  # from rest to rest
    planned = CubicSpline(times, samples)(clock)
    arm, fails = SimulatedArm(robot), round(moment / STEP)
    arm.data.qpos[:] = planned[0]
    found = arm.follow(planned, (joint, fails))
    noticed = len(arm.joints)
    if found is None:
        return Episode("unnoticed", np.nan, (fails, *[noticed] * 4), np.array(arm.joints))
    speed = (planned[noticed] - planned[noticed - 1]) / STEP
    brakes = np.minimum(np.arange(0.0, _BRAKES + _STANDS, STEP), _BRAKES)[:, None]
    standing = planned[noticed] + speed * (brakes - brakes**2 / (2 * _BRAKES))
    standing[:, found] = arm.data.qpos[found]
    arm.follow(standing)
    stands = back = len(arm.joints)
    standing[-1, found] = arm.data.qpos[found]
    start = np.clip(standing[-1], *healthy.chain.limits)
    # From the last sample that was passed: nothing is left out.
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
        grid = np.arange(0.0, run.duration + _STANDS, STEP)
        arm.follow(CubicSpline(run.times, run.positions)(np.minimum(grid, run.duration)))
    ends = (fails, noticed, stands, back, len(arm.joints))
    return Episode(answer.verdict, took, ends, np.array(arm.joints))
