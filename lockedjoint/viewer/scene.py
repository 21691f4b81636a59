"""A robot in the three-dimensional scene of a web page, as viser draws it.

What comes in: a `RobotPicture`, in metres along the axes of the arm's base, and a URDF file
with shapes. What goes out: objects of the scene; drawing one of the same name replaces it. The
robot's *size* is the largest distance of a joint or the tip from the base.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lockedjoint.formulations.io.files import read_bytes
from lockedjoint.kinematics.description import Description
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError
from lockedjoint.viewer.drawn_urdf import drawn_urdf
from lockedjoint.viewer.picture import NO_ARROW, RobotPicture

if TYPE_CHECKING:
    from viser import ViserServer

# Radius of an ellipsoid of velocity 1 (in units of the characteristic length), in shares of the
# robot's size.
_ELLIPSOID_SHARE = 0.12
# Length of the arrow of the worst direction, in shares of the robot's size.
_ARROW_SHARE = 0.35
# Half the length of a joint's axis, in shares of the robot's size.
_HALF_AXIS_SHARE = 0.06
# Width of a line, in shares of the robot's size.
_WIDTH_SHARE = 0.005
# Widths of a joint's axis, and of the head of an arrow, in widths of a line.
_AXIS_WIDTHS = 3
_HEAD_RADIUS_WIDTHS = 2.5
_HEAD_LENGTH_WIDTHS = 6
# Opacity of a mesh around the arm, from 0 to 1.
_MESH_OPACITY = 0.25
# Number of times that the triangles of a ball are divided: 320 triangles.
_BALL_SUBDIVISIONS = 2
# Vector in place of an arrow that is hidden: one of length 0 would have no direction.
_HIDDEN_ARROW = np.array([0.0, 0.0, 1e-6])
# Colours and looks of the ellipsoids before and after a failure, as viser takes them.
_BEFORE: dict[str, Any] = {"color": (0, 114, 178), "wireframe": True, "opacity": 0.35}
_AFTER: dict[str, Any] = {"color": (230, 159, 0), "wireframe": False, "opacity": 0.6}
# Colours, as red, green and blue from 0 to 255.
_LINEAR_RGB = (200, 0, 0)
_ROTATIONAL_RGB = (110, 50, 160)
_FREE_RGB = (0, 114, 178)
_LOCKED_RGB = (213, 30, 30)
_SKELETON_RGB = (90, 90, 90)
_PATH_RGB = (0, 158, 115)
_MESH_RGB = (0, 158, 115)
# Place of the camera from the robot's middle, in shares of its size.
_EYE = np.array([1.0, -0.85, 0.5])


class Scene:
    """An arm, its joints and the velocities of its tip.

    The shapes are those of a URDF file; where there are none, the arm is a row of lines and
    axes, and `notes` say in a sentence each what is not drawn. The camera looks at the
    configuration.
    """

    def __init__(
        self,
        server: ViserServer,
        arm: RobotArm,
        described: Description,
        configuration: FloatArray,
    ) -> None:
        self._server, self._arm, self._described = server, arm, described
        self.notes: list[str] = []
        self._model: Any = None
        self._drawn_urdf: Any = None
        self._place_camera(configuration)
        self._add_shapes()

    def add_mesh(self, file: Path) -> None:
        """Draw a mesh in the base's frame, as `workspace --out` writes; FileError if none."""
        import trimesh

        content = BytesIO(read_bytes(file, "beside"))
        try:
            mesh: Any = trimesh.load_mesh(content, file_type=file.suffix.lstrip("."))
            vertices, faces = np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces)
        except Exception:  # readers of meshes fail in any way
            raise FileError("beside", str(file), "a mesh in PLY, STL or OBJ") from None
        if not len(faces) or not np.all(np.isfinite(vertices)):
            raise FileError("beside", str(file), "a mesh with faces")
        self._server.scene.add_mesh_simple(
            "/mesh", vertices, faces, color=_MESH_RGB, opacity=_MESH_OPACITY, side="double"
        )

    def add_line(self, places: FloatArray) -> None:
        """Draw a line through places, shape (N, 3)."""
        pieces = np.stack([places[:-1], places[1:]], axis=1)
        width = _WIDTH_SHARE * self._size
        self._server.scene.add_line_segments(
            "/line", pieces, np.array(_PATH_RGB), thickness=width
        )

    def draw(self, shown: RobotPicture, positions: FloatArray) -> None:
        """Draw a picture, and the shapes at the joints' positions, shape (n,)."""
        self._draw_shapes(positions)
        self._draw_joints(shown)
        self._draw_velocities(shown)

    def _place_camera(self, configuration: FloatArray) -> None:
        """Measure the robot's size, and let the camera look at its middle."""
        _, origins, tip, _ = self._arm.chain.frames(configuration[:, None])
        places = np.vstack([np.zeros(3), origins[..., 0], tip.T])
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        self._size = float(np.max(np.linalg.norm(places - places[0], axis=1))) or 1.0
        camera = self._server.initial_camera
        camera.position = tuple(middle + _EYE * self._size)
        camera.look_at = tuple(middle)

    def _add_shapes(self) -> None:
        """Load the shapes of the URDF; a note says if they cannot be drawn."""
        file = self._described.file
        if file is None or not self._described.is_urdf:
            self.notes.append(f"No shapes are drawn: {file or 'a model'} is no URDF file")
            return
        import yourdfpy
        from viser.extras import ViserUrdf

        assert self._described.root is not None
        missing: set[str] = set()
        try:
            text, missing = drawn_urdf(self._described.root, file)
            same = yourdfpy.filename_handler_null
            self._model = yourdfpy.URDF.load(BytesIO(text), filename_handler=same)
            self._drawn_urdf = ViserUrdf(self._server, self._model, root_node_name="/robot")
        except Exception as error:
            # Shapes are of any format, and readers fail in any way: the arm is drawn as lines.
            self._model = self._drawn_urdf = None
            self.notes.append(f"Shapes of {file} are not drawn: {error}")
        else:
            if missing:
                shown = f"{len(missing)} shapes of {file} are not drawn"
                self.notes.append(f"{shown}: there is no {min(missing)}")

    def _draw_shapes(self, positions: FloatArray) -> None:
        """Move the URDF's shapes to where the joints are, shape (n,)."""
        if self._drawn_urdf is None:
            return
        chain = self._arm.chain
        where = dict(zip(chain.names, positions.tolist(), strict=True))
        where |= {**dict(chain.immobile), **dict(chain.locked_at)}
        values = [where.get(name, 0.0) for name in self._model.actuated_joint_names]
        self._drawn_urdf.update_cfg(np.array(values))
        # The scene's origin is the arm's base, wherever the robot's root is.
        root = np.linalg.inv(self._model.get_transform(chain.base, self._model.base_link))
        from viser.transforms import SO3

        wxyz = SO3.from_matrix(root[:3, :3]).wxyz
        self._server.scene.add_frame("/robot", wxyz=wxyz, position=root[:3, 3], show_axes=False)

    def _draw_joints(self, shown: RobotPicture) -> None:
        """Draw lines from joint to joint, and axes: another colour if the joint is locked."""
        scene, chain = self._server.scene, self._arm.chain
        places = np.vstack([np.zeros(3), shown.origins, shown.tip])
        links, width = np.stack([places[:-1], places[1:]], axis=1), _WIDTH_SHARE * self._size
        scene.add_line_segments("/links", links, np.array(_SKELETON_RGB), thickness=width)
        half = _HALF_AXIS_SHARE * self._size * shown.axes
        lines = np.stack([shown.origins - half, shown.origins + half], axis=1)
        names = [chain.joints[motion.variable].name for motion in chain.motions]
        shades = np.array(
            [_LOCKED_RGB if name in shown.locked else _FREE_RGB for name in names]
        )
        colours = np.repeat(shades[:, None], 2, axis=1)
        scene.add_line_segments("/axes", lines, colours, thickness=_AXIS_WIDTHS * width)

    def _draw_velocities(self, shown: RobotPicture) -> None:
        """Draw the ellipsoids of velocities at the tip, and arrows of the worst direction."""
        import trimesh

        scene, scale = self._server.scene, _ELLIPSOID_SHARE * self._size
        ball = trimesh.creation.icosphere(subdivisions=_BALL_SUBDIVISIONS, radius=1.0)
        vertices, faces = np.asarray(ball.vertices, dtype=float), np.asarray(ball.faces)
        both = ("before", shown.before, _BEFORE), ("after", shown.after, _AFTER)
        for name, axes, how in both:
            places = (shown.tip + scale * vertices @ axes.T).astype(np.float32)
            scene.add_mesh_simple(f"/velocities/{name}", places, faces, **how)
        for name, part, colour in (
            ("linear", shown.direction[:3], _LINEAR_RGB),
            ("rotational", shown.direction[3:], _ROTATIONAL_RGB),
        ):
            visible = bool(np.linalg.norm(part) > NO_ARROW)
            reach = _ARROW_SHARE * self._size * (part if visible else _HIDDEN_ARROW)
            arrow = np.stack([shown.tip, shown.tip + reach])[None].astype(np.float32)
            width = _WIDTH_SHARE * self._size
            scene.add_arrows(
                f"/worst/{name}",
                arrow,
                np.array(colour),
                shaft_radius=width,
                head_radius=_HEAD_RADIUS_WIDTHS * width,
                head_length=_HEAD_LENGTH_WIDTHS * width,
                visible=visible,
            )
