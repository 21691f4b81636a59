"""An arm under its own dynamics in MuJoCo: its controller, and joints that lock."""

import re

import mujoco
import numpy as np

from nlp.arrays import FloatArray
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
