"""A failure along two trajectories, side by side, as an animation."""

import io
import os
import sys
from collections.abc import Mapping
from itertools import pairwise

if sys.platform == "linux":  # as there may be no display; mujoco reads it at its import
    os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lockedjoint.nlp.arrays import FloatArray
from results.demonstration.simulated_arm import STEP, Episode, SimulatedArm

# Frames in a second.
_RATE = 12
# Width and height of a picture, and the height of the words above it, pixels.
_SIZE = 340
_WORDS = 50
# Seconds for which the end is shown.
_LAST = 2.0
# Colours: red, green, blue, opacity.
_GREY = (0.55, 0.55, 0.55, 1.0)
_RED = (0.8, 0.1, 0.1, 1.0)
_BLUE = (0.1, 0.3, 0.9, 1.0)


def animated(
    arm: SimulatedArm, path: FloatArray, joint: int, shown: Mapping[str, Episode]
) -> bytes:
    """Return a WebP of the failure of a joint, and the path by configurations on it, (K, n)."""
    line = [_tool(arm, q) for q in path]
    own = arm.model.geom_bodyid == arm.model.jnt_bodyid[joint]
    camera, font = mujoco.MjvCamera(), ImageFont.load_default(17)
    camera.lookat, camera.distance = [0.28, 0.0, 0.4], 1.15
    camera.azimuth, camera.elevation = 150, -15
    last = max(made.ends[-1] * STEP + made.recover_seconds for made in shown.values()) + _LAST
    frames = []
    with mujoco.Renderer(arm.model, _SIZE, _SIZE) as renderer:
        for moment in np.arange(0.0, last, 1 / _RATE):
            frame = Image.new("RGB", (_SIZE * len(shown), _SIZE + _WORDS), "white")
            for k, (name, made) in enumerate(shown.items()):
                step, words = _state(made, joint, round(moment / STEP))
                arm.model.geom_rgba[own] = _RED if step >= made.ends[0] else _GREY
                _tool(arm, made.joints[step])
                renderer.update_scene(arm.data, camera)
                _draw(renderer.scene, line)
                frame.paste(Image.fromarray(renderer.render()), (_SIZE * k, _WORDS))
                text = f"{name}\n{words}"
                ImageDraw.Draw(frame).text((_SIZE * k + 8, 4), text, "black", font)
            frames.append(frame)
    file, settings = io.BytesIO(), {"quality": 60, "method": 6, "duration": 1000 // _RATE}
    frames[0].save(file, "webp", save_all=True, append_images=frames[1:], loop=0, **settings)
    return file.getvalue()


def _state(made: Episode, joint: int, tick: int) -> tuple[int, str]:
    """Return the step and the words of a moment; the arm waits as long as `recover` takes."""
    fails, noticed, stands, _, end = made.ends
    waits = round(made.recover_seconds / STEP)
    going_on, finished = "goes on", "the path is finished"
    if made.verdict != "trajectory":
        going_on = finished = f"recover: {made.verdict}"
    said = {
        0: "",
        fails: f"joint {joint + 1} locks",
        noticed: f"noticed after {(noticed - fails) * STEP:.2f} s",
        stands: "recover …",
        stands + waits: going_on,
        end + waits: finished,
    }
    step = tick if tick < stands else max(stands - 1, tick - waits)
    return min(step, end - 1), said[max(each for each in said if each <= tick)]


def _tool(arm: SimulatedArm, q: FloatArray) -> FloatArray:
    """Move the arm and return where its tool is, metres."""
    arm.data.qpos[:] = q
    mujoco.mj_forward(arm.model, arm.data)
    return np.array(arm.data.body("panda_hand_tcp").xpos)


def _draw(scene: mujoco.MjvScene, line: list[FloatArray]) -> None:
    """Add a line to a picture."""
    capsule, nothing = mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3)
    for start, end in pairwise(line):
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, capsule, nothing, nothing, np.eye(3).ravel(), _BLUE)
        mujoco.mjv_connector(geom, capsule, 0.005, start, end)
        scene.ngeom += 1
