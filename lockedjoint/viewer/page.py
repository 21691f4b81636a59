"""A robot in a web page, with a slider and a lock for each joint.

What comes in: a `Robot` and a configuration. What goes out: a page that follows its sliders and
locks. What is drawn and said is a `picture` of the arm; `scene` draws it, by viser; `address`
has the server.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations.io.escaping import markdown
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LockedJointError, printable
from lockedjoint.robot import Robot
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.search import Search
from lockedjoint.viewer.address import Address, serve
from lockedjoint.viewer.picture import RobotPicture, numbers, picture
from lockedjoint.viewer.planned_path import PathPanel, PlannedPath
from lockedjoint.viewer.scene import Scene

# Largest step of a slider.
_LARGEST_STEP_M_OR_RAD = 1e-3
# Least number of steps of a slider: the step of a short range is smaller.
_LEAST_STEPS = 100
# Largest position of a revolute joint's slider to either side: wider limits are cut off.
_WIDEST_TURN_RAD = 2 * np.pi
# Largest position of a prismatic joint's slider to either side.
_WIDEST_TRAVEL_M = 2.0


@dataclass(eq=False)
class Page:
    """A web page with an arm, its sliders and its locks.

    Sliders and buttons call its methods from other threads, one at a time (`_lock`).

    Parameters
    ----------
    robot
        The robot; shapes are drawn if it is from a URDF file.
    configuration
        Where the sliders begin, shape (n,), radians or metres.
    address
        Where the page is served; it must be free.
    search
        How the best posture is looked for.
    path
        A planned path that is played; after a joint has locked it goes on as far as it can.
    mesh
        A file with a mesh that is drawn around the arm.

    Attributes
    ----------
    searching
        The thread that looks for the best posture; None before the first.
    panel
        The controls of the path, if there is one.
    notes
        Sentences on what cannot be drawn.
    """

    robot: Robot
    configuration: FloatArray
    address: Address
    search: Search
    path: PlannedPath | None = None
    mesh: Path | None = None
    searching: threading.Thread | None = None
    panel: PathPanel | None = None

    def __post_init__(self) -> None:
        self._server = serve(self.address)
        self._lock = threading.RLock()
        self._quiet = False  # while sliders are moved together, each of them draws nothing
        try:
            described = self.robot.description
            self._scene = Scene(self._server, self.arm, described, self.configuration)
            if self.mesh is not None:
                self._scene.add_mesh(self.mesh)
            if self.path is not None:
                self._scene.add_line(self.path.tool)
                self.panel = PathPanel(self._server.gui, self.path, self._move_all)
            self._add_controls()
            self.draw()
            if self.panel is not None:
                self.panel.draw()
        except BaseException:
            self._server.stop()
            raise
        self.notes = self._scene.notes

    @property
    def arm(self) -> RobotArm:
        """The arm of the robot."""
        return self.robot.arm

    def close(self) -> None:
        """End the server; a search that goes on ends with the process."""
        if self.panel is not None:
            self.panel.close()
        self._server.stop()

    @property
    def locked(self) -> tuple[str, ...]:
        """Names of the joints that are locked on the page."""
        return tuple(name for name, box in self._locks.items() if box.value)

    @property
    def positions(self) -> FloatArray:
        """Positions of the sliders, shape (n,)."""
        return np.array([float(slider.value) for slider in self._sliders.values()])

    def draw(self) -> RobotPicture:
        """Draw the arm where the sliders are; return what was drawn."""
        with self._lock:
            positions = self.positions
            shown = picture(self.arm, positions, self.locked)
            with self._server.atomic():
                self._scene.draw(shown, positions)
            self._numbers.content = numbers(shown, self.arm)
            return shown

    def move(self, positions: Mapping[str, float]) -> None:
        """Move the sliders of some joints to positions, radians or metres, and draw once."""
        with self._lock:
            self._quiet = True
            for name, value in positions.items():
                slider = self._sliders[name]
                slider.value = float(np.clip(value, slider.min, slider.max))
            self._quiet = False
            self.draw()

    def seek(self) -> None:
        """Look for the best posture of the joints that are not locked, in another thread."""
        with self._lock:
            if self.searching is not None and self.searching.is_alive():
                return
            starts = self.search.starts
            self._status.content = f"Looking for the best posture: {starts} starts …"
            where = dict(zip(self.arm.chain.names, self.positions.tolist(), strict=True))
            locked_at = {name: where[name] for name in self.locked}
            # A daemon thread does not keep the process alive after Ctrl-C.
            self.searching = threading.Thread(target=self._seek, args=(locked_at,), daemon=True)
            self.searching.start()

    def _seek(self, locked_at: Mapping[str, float]) -> None:
        """Search for the best posture when joints have locked at positions, and go there."""
        try:
            posture = best_posture(self._left(locked_at), self.search)
        except LockedJointError as error:
            self._status.content = markdown(str(error))
            return
        self._move_free(posture.assessment.q)
        of = f"{posture.reached_best} of {posture.starts} starts"
        sigma = posture.assessment.worst_case_sigma
        self._status.content = f"Best posture found by {of}: worst case {sigma:.6f}."

    def _left(self, locked: Mapping[str, float]) -> RobotArm:
        """Return the arm that is left when joints lock, by name and position."""
        if not locked:
            return self.arm
        chain = self.robot.with_locked(locked)
        return RobotArm(chain, self.arm.task, self.arm.length)

    def _move_free(self, positions: Mapping[str, float]) -> None:
        """Move the joints that are not locked."""
        self.move({name: value for name, value in positions.items() if name not in self.locked})

    def _move_all(self, positions: FloatArray) -> None:
        """Move all joints to positions, shape (n,)."""
        self.move(dict(zip(self.arm.chain.names, positions.tolist(), strict=True)))

    def _add_controls(self) -> None:
        """Add the numbers, the buttons, and a slider and a lock for each joint."""
        gui, chain = self._server.gui, self.arm.chain
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._numbers = gui.add_markdown("")
        middle = dict(zip(chain.names, chain.mid_range.tolist(), strict=True))
        gui.add_button("Best posture").on_click(lambda _: self.seek())
        gui.add_button("Middle of the limits").on_click(lambda _: self._move_free(middle))
        self._status = gui.add_markdown("")
        self._sliders: dict[str, Any] = {}
        self._locks: dict[str, Any] = {}
        for joint, value in zip(chain.joints, self.configuration.tolist(), strict=True):
            widest = _WIDEST_TRAVEL_M if joint.prismatic else _WIDEST_TURN_RAD
            low, high = max(joint.lower, -widest), min(joint.upper, widest)
            low, high = min(low, value), max(high, value)
            step = min(_LARGEST_STEP_M_OR_RAD, (high - low) / _LEAST_STEPS)
            label = printable(joint.name)
            slider = gui.add_slider(f"{label} ({joint.unit})", low, high, step, value)
            box = gui.add_checkbox(f"lock {label}", initial_value=False)
            slider.on_update(self._slid)
            box.on_update(partial(self._toggle, joint.name))
            self._sliders[joint.name], self._locks[joint.name] = slider, box

    def _slid(self, _: Any) -> None:
        """Draw, when the user has moved a slider."""
        if not self._quiet:
            self.draw()

    def _toggle(self, name: str, _: Any) -> None:
        """Lock or free a joint, when the user has clicked its box."""
        self._sliders[name].disabled = self._locks[name].value
        if self.panel is not None:
            self.panel.lock(self.locked)
        self.draw()
