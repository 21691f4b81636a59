"""A robot in a web page: what is drawn, and the page on which viser draws it.

`picture` is pure: from an arm, its configuration and the joints that have locked to all that is
shown. `Page` holds sliders, locks and buttons, and draws pictures.

Needs viser (the extra `view`), which is imported with the first page.
"""

from __future__ import annotations

import errno
import logging
import socket
import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.robots.chain import Chain
from formulations.robots.posture import Search, best_posture
from formulations.robots.read_urdf import is_urdf
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError, LockedJointError, MissingLibraryError
from nlp.files import read_bytes

if TYPE_CHECKING:
    from viser import ViserServer

# Sizes of what is drawn, in parts of the robot's size: an ellipsoid of velocity 1 (in units of
# the characteristic length), the worst direction, half of a joint's axis, a line's width.
_ELLIPSOID, _ARROW, _AXIS, _WIDTH = 0.12, 0.35, 0.06, 0.005
_BEFORE, _AFTER = (0, 114, 178), (230, 159, 0)
_LINEAR, _ROTATIONAL = (200, 0, 0), (110, 50, 160)
_FREE, _LOCKED, _SKELETON = (0, 114, 178), (213, 30, 30), (90, 90, 90)
# From where the robot is seen, in parts of its size.
_EYE = np.array([1.0, -0.85, 0.5])
# A slider's range where a joint has none, or a wider one: radians and metres.
_WIDEST_TURN, _WIDEST_TRAVEL = 2 * np.pi, 2.0
# A part of the worst direction below this is not drawn.
_NO_ARROW = 1e-9


@dataclass(frozen=True, eq=False)
class Picture:
    """What is drawn of an arm, in metres and along the axes of its base.

    Attributes
    ----------
    origins, axes
        Of the chain's motions from base to tip: where each joint is and its unit axis, shape
        (k, 3). Joints that mimic others have motions, too.
    tip
        Position of the tip's point, shape (3,).
    before, after
        Semi-axes of the ellipsoid of the tip's velocities at joint rates of norm 1, as columns,
        longest first, shape (3, 3), in units of ℓ: linear ones, or rotational ones where the
        task has no other. With all joints, and without those in `failed`.
    locked, failed
        The locked joints; and the same, or where none is locked, the joint whose failure would
        be the worst.
    direction
        The tip's velocity (v; ω) that suffers most after that, a unit vector in units of ℓ,
        shape (6,).
    length
        Characteristic length ℓ in metres.
    sigma, sigma_left
        Smallest singular value with all joints, and without the locked ones.
    worst_case, worst_joint
        Smallest singular value after one more failure, and which; 0 and None if there are
        not more joints left than the task has directions.
    """

    origins: FloatArray
    axes: FloatArray
    tip: FloatArray
    before: FloatArray
    after: FloatArray
    locked: tuple[str, ...]
    failed: tuple[str, ...]
    direction: FloatArray
    length: float
    sigma: float
    sigma_left: float
    worst_case: float
    worst_joint: str | None


def picture(
    arm: RobotArm, configuration: npt.ArrayLike, locked: Collection[str] = ()
) -> Picture:
    """Return what is drawn of an arm.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    configuration
        Positions of the free joints, radians or metres, shape (n,).
    locked
        Names of joints that have locked, where they are.

    Raises
    ------
    InputError
        If a joint is unknown, or the configuration is not one number for each.
    """
    names = arm.chain.names
    for name in locked:
        if name not in names:
            raise InputError("locked joint", name, "one of " + ", ".join(names))
    point = finite_vector("configuration", configuration, arm.size)
    matrix, m = arm.jacobian(point), arm.shape[0]
    gone = [k for k, name in enumerate(names) if name in locked]
    left = np.delete(matrix, gone, axis=1)
    worst_case, worst_joint = 0.0, None
    if left.shape[1] > m:
        found = measures.worst_case(left)
        kept = [name for name in names if name not in locked]
        worst_case, worst_joint = found.sigma, kept[found.joints[0]]
    failed = gone or ([names.index(worst_joint)] if worst_joint else [])
    after = np.delete(matrix, failed, axis=1)
    origins, axes, pose = frames(arm.chain, point)
    turn = pose[:3, :3] if arm.task.frame == "tip" else np.eye(3)
    rows = slice(0, 3) if arm.task.linear else slice(3, 6)
    direction = _along_base(arm, measures.weakest_direction(after)[:, None], turn)[:, 0]
    return Picture(
        origins=origins,
        axes=axes,
        tip=pose[:3, 3],
        before=semi_axes(_along_base(arm, matrix, turn)[rows]),
        after=semi_axes(_along_base(arm, after, turn)[rows]),
        locked=tuple(names[k] for k in gone),
        failed=tuple(names[k] for k in failed),
        direction=direction,
        length=arm.length_at(point),
        sigma=_smallest(matrix),
        sigma_left=_smallest(left),
        worst_case=worst_case,
        worst_joint=worst_joint,
    )


def frames(
    chain: Chain, configuration: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return origins and unit axes of a chain's motions, (k, 3), and its tip's pose, 4×4."""
    from formulations.realise.chain import rotation

    pose = np.eye(4)
    origins, axes = [], []
    for motion in chain.motions:
        pose = pose @ np.array(motion.placement)
        axis, moved = np.array(motion.axis), np.eye(4)
        value = motion.multiplier * configuration[motion.variable] + motion.offset
        origins.append(pose[:3, 3])
        axes.append(pose[:3, :3] @ axis)
        if motion.translates:
            moved[:3, 3] = value * axis
        else:
            moved[:3, :3] = rotation(axis, np.asarray(value))
        pose = pose @ moved
    return np.array(origins), np.array(axes), pose @ np.array(chain.end)


def semi_axes(matrix: FloatArray) -> FloatArray:
    """Return the semi-axes of {A·x : |x| ≤ 1} as columns, longest first; A has shape (3, k)."""
    left, values, _ = np.linalg.svd(matrix)
    lengths = np.zeros(3)
    lengths[: len(values)] = values
    return np.asarray(left * lengths)


def _smallest(matrix: FloatArray) -> float:
    m, n = matrix.shape
    return float(np.linalg.svd(matrix, compute_uv=False)[-1]) if n >= m else 0.0


def _along_base(arm: RobotArm, matrix: FloatArray, turn: FloatArray) -> FloatArray:
    """Return rows of the task as all six (v; ω) along the base's axes, 0 where it has none."""
    full = np.zeros((6, matrix.shape[1]))
    full[arm.task.rows] = matrix
    return np.vstack([turn @ full[:3], turn @ full[3:]])


def numbers(shown: Picture, arm: RobotArm) -> str:
    """Return the numbers of a picture as Markdown."""
    largest = [f"{np.linalg.norm(one[:, 0]):.4f}" for one in (shown.before, shown.after)]
    direction = "  ".join(
        f"{name} {value:+.2f}"
        for name, value in zip(
            ("vx", "vy", "vz", "wx", "wy", "wz"), shown.direction, strict=True
        )
        if arm.task.mixed or abs(value) > _NO_ARROW
    )
    rows = {
        "sigma, all joints": f"{shown.sigma:.4f}",
        "sigma, locked joints out": f"{shown.sigma_left:.4f}",
        "worst case of one more": f"**{shown.worst_case:.4f}**",
        "worst joint": shown.worst_joint or "no joint to spare",
        "locked": ", ".join(shown.locked) or "none",
        "largest velocity": " → ".join(largest),
        "worst direction": direction,
        "length": f"{shown.length:.4f} m",
    }
    lines = [f"| {name} | {value} |" for name, value in rows.items()]
    return "\n".join(["| | |", "|:--|:--|", *lines])


@dataclass(frozen=True)
class Address:
    """Where a page is served, and from whom.

    Attributes
    ----------
    host, port
        Of this machine; port 0 for any free one.
    """

    host: str = "127.0.0.1"
    port: int = 8080

    def free(self) -> Address:
        """Return the address with a port that can be listened on.

        Raises
        ------
        InputError
            If there is no such host here, or the port is in use or not allowed.
        """
        try:
            family, kind, _, _, where = socket.getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
        except (OSError, UnicodeError):
            allowed = "a name or an address of this machine, such as 127.0.0.1"
            raise InputError("--host", self.host, allowed) from None
        with socket.socket(family, kind) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind(where)
                tried.listen(1)
            except OSError as error:
                if error.errno in (errno.EADDRINUSE, errno.EACCES):
                    used = error.errno == errno.EADDRINUSE
                    why = "in use" if used else "not allowed to this user"
                    allowed = f"a free port of {self.host}, or 0 for any"
                    raise InputError("--port", f"{self.port}, {why}", allowed) from None
                allowed = "a name or an address of this machine, such as 127.0.0.1"
                raise InputError("--host", self.host, allowed) from None
            return Address(self.host, int(tried.getsockname()[1]))

    @property
    def local(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in ("127.0.0.1", "::1", "localhost")

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"


@dataclass(eq=False)
class Page:
    """A web page with an arm, its sliders and its locks.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    remaining
        Makes the arm that is left when joints lock, by name and position.
    file
        The URDF whose shapes are drawn; without one, or where it cannot be drawn, the arm is a
        row of lines and axes.
    configuration
        Where the sliders begin.
    address
        Where the page is served; it must be free.
    search
        How the best posture is looked for.
    """

    arm: RobotArm
    remaining: Callable[[Mapping[str, float]], RobotArm]
    file: Path | None
    configuration: FloatArray
    address: Address
    search: Search
    notes: list[str] = field(default_factory=list)
    searching: threading.Thread | None = None

    def __post_init__(self) -> None:
        self._server = _server(self.address)
        self._lock = threading.RLock()
        self._quiet = False
        self._model: Any = None
        self._drawn_urdf: Any = None
        origins, _, pose = frames(self.arm.chain, self.configuration)
        places = np.vstack([np.zeros(3), origins, pose[:3, 3]])
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        self._size = float(np.max(np.linalg.norm(places - places[0], axis=1))) or 1.0
        camera = self._server.initial_camera
        camera.position = tuple(middle + _EYE * self._size)
        camera.look_at = tuple(middle)
        try:
            self._add_shapes()
            self._add_controls()
            self.draw()
        except BaseException:
            self._server.stop()
            raise

    def close(self) -> None:
        """End the server; a search that goes on ends with the process."""
        with redirect_stdout(StringIO()):
            self._server.stop()

    @property
    def locked(self) -> tuple[str, ...]:
        """Names of the joints that are locked on the page."""
        return tuple(name for name, box in self._locks.items() if box.value)

    @property
    def positions(self) -> FloatArray:
        """Positions of the sliders, shape (n,)."""
        return np.array([float(slider.value) for slider in self._sliders.values()])

    def draw(self) -> Picture:
        """Draw the arm where the sliders are; return what was drawn."""
        with self._lock:
            shown = picture(self.arm, self.positions, self.locked)
            with self._server.atomic():
                self._draw_shapes()
                self._draw_joints(shown)
                self._draw_velocities(shown)
            self._numbers.content = numbers(shown, self.arm)
            return shown

    def move(self, positions: Mapping[str, float]) -> None:
        """Move sliders, and draw once."""
        with self._lock:
            self._quiet = True
            try:
                for name, value in positions.items():
                    slider = self._sliders[name]
                    slider.value = float(np.clip(value, slider.min, slider.max))
            finally:
                self._quiet = False
            self.draw()

    def seek(self) -> None:
        """Look for the best posture of the joints that are not locked, in another thread."""
        with self._lock:
            if self.searching is not None and self.searching.is_alive():
                return
            where = dict(zip(self.arm.chain.names, self.positions.tolist(), strict=True))
            held = {name: where[name] for name in self.locked}
            self._status.content = (
                f"Looking for the best posture: {self.search.starts} starts …"
            )
            # A daemon: it does not keep the process after Ctrl-C.
            self.searching = threading.Thread(target=self._seek, args=(held,), daemon=True)
            self.searching.start()

    def _seek(self, held: Mapping[str, float]) -> None:
        try:
            arm = self.remaining(held) if held else self.arm
            found = best_posture(arm, self.search)
        except LockedJointError as error:
            self._status.content = str(error)
            return
        sigma = found.assessment.worst_case_sigma
        best = found.assessment.configuration
        self.move({name: value for name, value in best.items() if name not in self.locked})
        of = f"{found.reached_best} of {found.starts} starts"
        self._status.content = f"Best posture found by {of}: worst case {sigma:.6f}."

    def _add_controls(self) -> None:
        gui, chain = self._server.gui, self.arm.chain
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._numbers = gui.add_markdown("")
        best = gui.add_button("Best posture")
        middle = gui.add_button("Middle of the limits")
        self._status = gui.add_markdown("")
        best.on_click(lambda _: self.seek())
        free = dict(zip(chain.names, chain.mid_range.tolist(), strict=True))
        middle.on_click(
            lambda _: self.move({k: v for k, v in free.items() if k not in self.locked})
        )
        self._sliders: dict[str, Any] = {}
        self._locks: dict[str, Any] = {}
        for joint, value in zip(chain.joints, self.configuration.tolist(), strict=True):
            widest = _WIDEST_TRAVEL if joint.prismatic else _WIDEST_TURN
            low, high = max(joint.lower, -widest), min(joint.upper, widest)
            low, high = min(low, value), max(high, value)
            step = min(1e-3, (high - low) / 100)
            slider = gui.add_slider(joint.name, low, high, step, value)
            box = gui.add_checkbox(f"lock {joint.name}", initial_value=False)
            slider.on_update(self._slid)
            box.on_update(partial(self._turn_lock, joint.name))
            self._sliders[joint.name], self._locks[joint.name] = slider, box

    def _slid(self, _: Any) -> None:
        if not self._quiet:
            self.draw()

    def _turn_lock(self, name: str, _: Any) -> None:
        self._sliders[name].disabled = self._locks[name].value
        self.draw()

    def _add_shapes(self) -> None:
        """Load the shapes of the URDF; a note says if they cannot be drawn."""
        if self.file is None:
            return
        if not is_urdf(read_bytes(self.file)):
            self.notes.append(f"No shapes are drawn: {self.file} is no URDF file")
            return
        import yourdfpy
        from viser.extras import ViserUrdf

        log, heard = logging.getLogger("yourdfpy"), _Heard()
        before, log.propagate = log.propagate, False
        log.addHandler(heard)
        found = partial(yourdfpy.filename_handler_magic, dir=self.file.parent)
        try:
            self._model = yourdfpy.URDF.load(str(self.file), filename_handler=found)
            self._drawn_urdf = ViserUrdf(self._server, self._model, root_node_name="/robot")
        except Exception as error:
            # Shapes are of any format, and readers fail in any way: the arm is drawn as lines.
            self._model = self._drawn_urdf = None
            self.notes.append(f"Shapes of {self.file} are not drawn: {error}")
        else:
            missing = len(heard.sentences)
            if missing:
                first = heard.sentences[0]
                self.notes.append(f"{missing} shapes of {self.file} are not drawn: {first}")
        finally:
            log.removeHandler(heard)
            log.propagate = before

    def _draw_shapes(self) -> None:
        if self._model is None or self._drawn_urdf is None:
            return
        chain = self.arm.chain
        where = dict(zip(chain.names, self.positions.tolist(), strict=True))
        where |= {**dict(chain.immobile), **dict(chain.held)}
        values = [where.get(name, 0.0) for name in self._model.actuated_joint_names]
        self._drawn_urdf.update_cfg(np.array(values))
        # The scene's origin is the arm's base, wherever the robot's root is.
        root = np.linalg.inv(self._model.get_transform(chain.base, self._model.base_link))
        from viser.transforms import SO3

        turn = SO3.from_matrix(root[:3, :3]).wxyz
        self._server.scene.add_frame("/robot", wxyz=turn, position=root[:3, 3], show_axes=False)

    def _draw_joints(self, shown: Picture) -> None:
        scene, chain = self._server.scene, self.arm.chain
        places = np.vstack([np.zeros(3), shown.origins, shown.tip])
        links, width = np.stack([places[:-1], places[1:]], axis=1), _WIDTH * self._size
        scene.add_line_segments("/links", links, np.array(_SKELETON), thickness=width)
        half = _AXIS * self._size * shown.axes
        lines = np.stack([shown.origins - half, shown.origins + half], axis=1)
        names = [chain.joints[motion.variable].name for motion in chain.motions]
        shades = np.array([_LOCKED if name in self.locked else _FREE for name in names])
        colours = np.repeat(shades[:, None], 2, axis=1)
        scene.add_line_segments("/axes", lines, colours, thickness=3 * width)

    def _draw_velocities(self, shown: Picture) -> None:
        scene = self._server.scene
        vertices, faces = _sphere()
        scale = _ELLIPSOID * self._size
        for name, axes, colour in (
            ("before", shown.before, _BEFORE),
            ("after", shown.after, _AFTER),
        ):
            scene.add_mesh_simple(
                f"/velocities/{name}",
                (shown.tip + scale * vertices @ axes.T).astype(np.float32),
                faces,
                color=colour,
                wireframe=name == "before",
                opacity=0.35 if name == "before" else 0.6,
            )
        for name, part, colour in (
            ("linear", shown.direction[:3], _LINEAR),
            ("rotational", shown.direction[3:], _ROTATIONAL),
        ):
            size = float(np.linalg.norm(part))
            visible = size > _NO_ARROW
            reach = _ARROW * self._size * (part if visible else np.array([0.0, 0.0, 1e-6]))
            arrow = np.stack([shown.tip, shown.tip + reach])[None].astype(np.float32)
            width = _WIDTH * self._size
            scene.add_arrows(
                f"/worst/{name}",
                arrow,
                np.array(colour),
                shaft_radius=width,
                head_radius=2.5 * width,
                head_length=6 * width,
                visible=visible,
            )


class _Heard(logging.Handler):
    """Keeps what a library warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.sentences: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one sentence."""
        self.sentences.append(record.getMessage())


def _server(address: Address) -> ViserServer:
    try:
        import viser
    except ImportError:
        raise MissingLibraryError("viser", "view") from None

    class Server(viser.ViserServer):
        """A server that opens no tunnel to the internet, whoever asks for one."""

        def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
            return None

    with redirect_stdout(StringIO()):  # its own greeting
        server = Server(address.host, address.port, label="lockedjoint", verbose=False)
    if server.get_port() != address.port:
        server.stop()
        allowed = f"a free port of {address.host}, or 0 for any"
        raise InputError("--port", f"{address.port}, in use", allowed)
    return server


def _sphere() -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return vertices (k, 3) and faces of a unit sphere."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    return np.asarray(ball.vertices, dtype=float), np.asarray(ball.faces)
