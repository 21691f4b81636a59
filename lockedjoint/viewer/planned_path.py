"""A path that `path` has written: what a failure leaves of it, and controls that play it.

N samples of the path, n joints. Configurations are rows, shape (N, n), radians or (prismatic
joints) metres. Times are seconds; a time that a method takes is from the start of the path.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations.io.escaping import markdown
from lockedjoint.formulations.io.files import load_json, read_bytes
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.paths.following import follow
from lockedjoint.paths.survival import CENTRE_SHARE
from lockedjoint.paths.waypoints import Poses

# Seconds between two pictures of a path that is played: with less, the page has to draw more
# often.
_FRAME_SECONDS = 0.1
# Number of steps of the slider over the whole path.
_SLIDER_STEPS = 500


@dataclass(frozen=True, eq=False)
class LockOnPath:
    """A joint that locks on the path.

    Attributes
    ----------
    joint, sample
        Numbers of the joint and of the sample at which it locks, from 0.
    end
        Number of the last sample that the others reach.
    configurations
        Configurations of the whole path, shape (N, n): as planned up to the failure, then with
        the joint locked, and after `end` where the others stay.
    """

    joint: int
    sample: int
    end: int
    configurations: FloatArray


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A trajectory of an arm's joints, and what is left of the path after each failure.

    Attributes
    ----------
    arm
        The arm, with the task of the path.
    times
        Times of the samples, ascending, shape (N,).
    configurations
        Configurations at the samples, shape (N, n).
    ends
        Entry (k, f) is the last sample that is reached if joint f locks at sample k, (N, n).
    """

    arm: RobotArm
    times: FloatArray
    configurations: FloatArray
    ends: IntArray

    @classmethod
    def read(cls, file: Path, arm: RobotArm, name: str = "beside") -> PlannedPath:
        """Read the path.json that `path` writes, of the same arm; FileError if it is none."""
        values = load_json(read_bytes(file, name), file)
        names = list(arm.chain.names)
        wrong = FileError(name, str(file), f"the path.json of `path` for {', '.join(names)}")
        try:
            task = TaskSpace(tuple(values["task"]), "base")
            joints = [row["joint"] for row in values["joints"]]
            way = values["trajectory"]
            given = values["times"], way["configurations"], way["ends_at"]
            times, configurations, ends = (as_floats("trajectory", each) for each in given)
        except (KeyError, TypeError, InputError):
            raise wrong from None
        shape = (times.size, arm.size)
        if joints != names or not configurations.shape == ends.shape == shape:
            raise wrong
        rising = times.ndim == 1 and len(times) > 1 and bool(np.all(np.diff(times) > 0))
        if not rising or not np.isfinite(times).all():
            raise wrong
        samples = np.searchsorted(times, ends)  # NaN comes last
        early = samples < np.arange(len(times))[:, None]
        if np.any(early | (samples >= len(times))) or not np.isfinite(configurations).all():
            raise wrong
        return cls(RobotArm(arm.chain, task, arm.length), times, configurations, samples)

    @property
    def duration(self) -> float:
        """Duration of the path, in seconds."""
        return float(self.times[-1] - self.times[0])

    @property
    def tool(self) -> FloatArray:
        """Positions of the tip's point at the samples, in the base, shape (N, 3)."""
        return self.arm.chain.tip_at(self.configurations.T)[0].T

    def nearest(self, time: float) -> int:
        """Return the sample that is nearest to a time from the start."""
        return int(np.argmin(np.abs(self.times - self.times[0] - time)))

    def at(self, time: float, failure: LockOnPath | None = None) -> FloatArray:
        """Return where the joints are at a time from the start, shape (n,)."""
        way = self.configurations if failure is None else failure.configurations
        when = self.times - self.times[0]
        return np.array([np.interp(time, when, column) for column in way.T])

    def after(self, joint: int, sample: int) -> LockOnPath:
        """Lock a joint at a sample, and follow the path with the others.

        The others follow to where `path` found that they end, or less far: `path` tried
        several ways to follow, and this is one of them.
        """
        origins, rotations = self.arm.chain.tip_at(self.configurations.T)
        poses = Poses(origins.T, np.moveaxis(rotations, 2, 0), self.arm.task.rows)
        start = self.configurations[sample][:, None]
        # An arm with joints to spare is drawn to the middle of its limits.
        centre = CENTRE_SHARE if self.arm.size - 1 > len(self.arm.task.rows) else 0.0
        track, last = follow(
            self.arm.chain, start, poses, sample, joint=np.array([joint]), centre=centre
        )
        end = min(int(last[0]), int(self.ends[sample, joint]))
        way = self.configurations.copy()
        way[sample : end + 1] = track[sample : end + 1, :, 0]
        way[end + 1 :] = way[end]
        return LockOnPath(joint, sample, end, way)

    def words(self, time: float, failure: LockOnPath | None = None) -> str:
        """Say in Markdown what a failure leaves of the path.

        That is the failure which happened, or else each one that could happen at this time.
        """
        names = [markdown(name) for name in self.arm.chain.names]
        when = self.times - self.times[0]
        of = f"of {self.duration:.2f} s"
        if failure is not None:
            end = int(self.ends[failure.sample, failure.joint])
            ends = f"the path ends at {when[end]:.2f} s"
            ends = "the rest can be finished" if end == len(when) - 1 else ends
            short = f" (shown to {when[failure.end]:.2f} s)" if failure.end < end else ""
            locked = f"{names[failure.joint]} locked at {when[failure.sample]:.2f} s"
            return f"{time:.2f} s {of}. **{locked}: {ends}**{short}."
        ends_now = self.ends[self.nearest(time)]
        fatal = [
            f"{name} (ends at {when[end]:.2f} s)"
            for name, end in zip(names, ends_now, strict=True)
            if end < len(when) - 1
        ]
        if not fatal:
            return f"{time:.2f} s {of}. The rest can be finished whichever joint locks now."
        listed = ", ".join(fatal)
        return f"{time:.2f} s {of}. It cannot be finished if one of these locks now: {listed}."


class PathPanel:
    """A slider of time, a button that plays, and a sentence on what failures leave.

    `gui` is viser's, and `show` draws the arm at a configuration, shape (n,). A joint locks at
    the sample nearest to the slider's time.
    """

    def __init__(self, gui: Any, path: PlannedPath, show: Callable[[FloatArray], None]) -> None:
        self._path, self._show = path, show
        self.failure: LockOnPath | None = None
        self._playing = threading.Event()
        self._player: threading.Thread | None = None
        self._text = gui.add_markdown("")
        step = path.duration / _SLIDER_STEPS
        self.time = gui.add_slider("time", 0.0, path.duration, step, 0.0)
        self.time.on_update(lambda _: self.draw())
        self._button = gui.add_button("Play")
        self._button.on_click(lambda _: self.play())

    def draw(self) -> None:
        """Draw the arm where it is at this time, and say what is left of the path."""
        now = float(self.time.value)
        self._show(self._path.at(now, self.failure))
        self._text.content = self._path.words(now, self.failure)

    def lock(self, joints: Sequence[str]) -> None:
        """Let the path go on without a joint that has locked, or with all again."""
        path = self._path
        if not joints:
            self.failure = None
        elif len(joints) == 1:
            sample = path.nearest(float(self.time.value))
            self.failure = path.after(path.arm.chain.names.index(joints[0]), sample)
            self.time.value = float(path.times[sample] - path.times[0])
        self.draw()
        if len(joints) > 1:
            self._text.content = "Only the first joint that locks is followed along the path."

    def play(self) -> None:
        """Play the path to its end, from the start if it is there; or stop."""
        if self._playing.is_set():
            self._playing.clear()
            return
        if self.time.value >= self._path.duration:
            self.time.value = 0.0
        self._playing.set()
        self._player = threading.Thread(target=self._play, daemon=True)
        self._player.start()

    def close(self) -> None:
        """Stop playing: the page is about to be closed."""
        self._playing.clear()
        if self._player is not None:
            self._player.join()

    def _play(self) -> None:
        """Move the slider as time goes by, until the end or until somebody stops it."""
        self._button.label = "Stop"
        began, start = time.monotonic(), float(self.time.value)
        while self._playing.is_set() and self.time.value < self._path.duration:
            now = start + time.monotonic() - began
            self.time.value = min(now, self._path.duration)
            time.sleep(_FRAME_SECONDS)
        self._playing.clear()
        self._button.label = "Play"
