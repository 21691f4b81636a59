"""A failure along two trajectories, side by side, as an animation.

What comes in: a simulated arm, its path, the joint that fails, and an `Episode` for each
trajectory. What goes out: the bytes of a WebP file. Configurations q of n joints have shape
(n,) and are in radians; steps are those of the simulation, `STEP` seconds each. All numbers
below change how the animation looks, and nothing else.
"""

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
_RATE_HZ = 12
# Width and height of a picture, in pixels.
_PICTURE_PIXELS = 340
# Height of the words above a picture, in pixels.
_WORDS_PIXELS = 50
# Height of a letter, in pixels.
_LETTER_PIXELS = 17
# Where words begin, from the left and the upper edge of a picture, in pixels.
_MARGIN_LEFT = 8
_MARGIN_TOP = 4
# Seconds for which the end is shown.
_LAST_SECONDS = 2.0
# The colour of links, as red, green, blue and opacity from 0 to 1.
_GREY = (0.55, 0.55, 0.55, 1.0)
# The colour of the link behind the joint that has failed.
_RED = (0.8, 0.1, 0.1, 1.0)
# The colour of the path.
_BLUE = (0.1, 0.3, 0.9, 1.0)
# The radius of the path's line, in metres.
_LINE_RADIUS_M = 0.005
# The camera looks at this point of the base's frame, in metres.
_LOOK_AT_M = (0.28, 0.0, 0.4)
# The camera is so far from the point, in metres.
_DISTANCE_M = 1.15
# The camera looks along this bearing, in degrees.
_AZIMUTH_DEGREES = 150
# The camera looks down by this, in degrees.
_ELEVATION_DEGREES = -15
# The quality of the pictures, from 0 to 100, and the slowest, best compression.
_FILE: Mapping[str, int] = {"quality": 60, "method": 6}


def animated(
    arm: SimulatedArm, path: FloatArray, joint: int, shown: Mapping[str, Episode]
) -> bytes:
    """Return a WebP of the failure of a joint, and the path by configurations on it, (K, n)."""
    line = [_tool(arm, q) for q in path]
    own_link = arm.model.geom_bodyid == arm.model.jnt_bodyid[joint]
    font = ImageFont.load_default(_LETTER_PIXELS)
    camera = mujoco.MjvCamera()
    camera.lookat = list(_LOOK_AT_M)
    camera.distance = _DISTANCE_M
    camera.azimuth = _AZIMUTH_DEGREES
    camera.elevation = _ELEVATION_DEGREES
    last = _LAST_SECONDS + max(
        episode.ends[-1] * STEP + episode.recover_seconds for episode in shown.values()
    )
    frames = []
    with mujoco.Renderer(arm.model, _PICTURE_PIXELS, _PICTURE_PIXELS) as renderer:
        for moment in np.arange(0.0, last, 1 / _RATE_HZ):
            frame = Image.new(
                "RGB", (_PICTURE_PIXELS * len(shown), _PICTURE_PIXELS + _WORDS_PIXELS), "white"
            )
            for place, (name, episode) in enumerate(shown.items()):
                step, words = _state(episode, joint, round(moment / STEP))
                arm.model.geom_rgba[own_link] = _RED if step >= episode.ends[0] else _GREY
                _tool(arm, episode.joints[step])
                renderer.update_scene(arm.data, camera)
                _draw(renderer.scene, line)
                frame.paste(
                    Image.fromarray(renderer.render()), (_PICTURE_PIXELS * place, _WORDS_PIXELS)
                )
                text = f"{name}\n{words}"
                ImageDraw.Draw(frame).text(
                    (_PICTURE_PIXELS * place + _MARGIN_LEFT, _MARGIN_TOP), text, "black", font
                )
            frames.append(frame)
    file = io.BytesIO()
    settings = {**_FILE, "duration": 1000 // _RATE_HZ}
    frames[0].save(file, "webp", save_all=True, append_images=frames[1:], loop=0, **settings)
    return file.getvalue()


def _state(episode: Episode, joint: int, tick: int) -> tuple[int, str]:
    """Return the step and the words of a moment; the arm waits as long as `recover` takes."""
    fails, noticed, stands, _, end = episode.ends
    waits = round(episode.recover_seconds / STEP)
    going_on, finished = "goes on", "the path is finished"
    if episode.verdict != "trajectory":
        going_on = finished = f"recover: {episode.verdict}"
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
        mujoco.mjv_connector(geom, capsule, _LINE_RADIUS_M, start, end)
        scene.ngeom += 1
