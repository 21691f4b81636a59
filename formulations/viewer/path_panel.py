"""The controls that play a planned path on a page: a time, and what a locked joint leaves."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from formulations.viewer.planned_path import LockOnPath, PlannedPath
from nlp.arrays import FloatArray

# Seconds between two pictures of a path that is played; what a click on the slider counts.
_FRAME, _STEPS = 0.1, 500


class PathPanel:
    """A slider of time, a button that plays, and a sentence on what failures leave.

    `show` draws the arm at a configuration. A joint that locks does so at the nearest sample.
    """

    def __init__(self, gui: Any, path: PlannedPath, show: Callable[[FloatArray], None]) -> None:
        self._path, self._show = path, show
        self.failure: LockOnPath | None = None
        self._playing = threading.Event()
        self._player: threading.Thread | None = None
        self._text = gui.add_markdown("")
        step = path.duration / _STEPS
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
        """Stop, before the page is closed that it plays on."""
        self._playing.clear()
        if self._player is not None:
            self._player.join()

    def _play(self) -> None:
        self._button.label = "Stop"
        began, start = time.monotonic(), float(self.time.value)
        while self._playing.is_set() and self.time.value < self._path.duration:
            now = start + time.monotonic() - began
            self.time.value = min(now, self._path.duration)
            time.sleep(_FRAME)
        self._playing.clear()
        self._button.label = "Play"
