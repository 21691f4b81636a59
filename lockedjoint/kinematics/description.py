"""What is read of a robot, once: its tree, and the text or the model that says the rest.

The rest is the geometry of links, which clearance and pictures need, masses, which a joint that
swings freely needs, and the states that have names.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from lockedjoint.kinematics.read_robot import read_model, robot_file, tree_of_text
from lockedjoint.kinematics.read_urdf import content_of, xml_root
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.errors import InputError

#: A state has positions of joints by name, radians or metres.
State = Mapping[str, float]
# A joint of one of these MJCF types has so many entries in `qpos`: a position and a quaternion,
# or a quaternion. Any other has one.
_POSITIONS = {"free": 7, "ball": 4}
# MuJoCo numbers the types of joints: free 0, ball 1, slide 2, hinge 3. From this on a joint has
# one position.
_FIRST_SINGLE_TYPE = 2


@dataclass(frozen=True, eq=False, repr=False)
class Description:
    """A robot as it was read.

    Attributes
    ----------
    tree
        Its links and joints.
    file
        The path of the file; None of a model.
    text
        The content of the file; empty of a model.
    model
        The model; None of a file.
    """

    tree: RobotTree
    file: Path | None = None
    text: bytes = b""
    model: object = field(default=None)

    @classmethod
    def read(cls, source: object) -> Description:
        """Read a robot's file once, or a model; see `read_robot` for what they may be."""
        if isinstance(source, Description):
            return source
        if isinstance(source, str | os.PathLike):
            file = robot_file(source)
            text = content_of(file)
            return cls(tree_of_text(file, text), file, text)
        return cls(read_model(source), model=source)

    @cached_property
    def root(self) -> Element | None:
        """The root of the file's XML; None of a model or a table."""
        with suppress(InputError):
            return xml_root(self.text) if self.text else None
        return None

    @property
    def is_urdf(self) -> bool:
        """Whether it was read from a URDF file."""
        return self.root is not None and self.root.tag == "robot"

    @cached_property
    def states(self) -> Mapping[str, State]:
        """States that have a name: MJCF's key frames, pinocchio's reference configurations."""
        model: Any = self.model
        if hasattr(model, "referenceConfigurations"):
            return {name: _of_pinocchio(model, q) for name, q in _references(model)}
        if hasattr(model, "nkey"):
            return {
                model.key(k).name: _of_mujoco(model, model.key_qpos[k])
                for k in range(model.nkey)
                if model.key(k).name
            }
        return {} if self.root is None else dict(_key_frames(self.root))


def _references(model: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and configuration, (nq,), of the reference configurations of pinocchio."""
    for entry in model.referenceConfigurations:
        yield str(entry.key()), np.asarray(entry.data())


def _of_pinocchio(model: Any, q: Any) -> State:
    """Return a configuration of pinocchio, (nq,), by joint, but for ball and free joints."""
    state = {}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        part = q[joint.idx_q : joint.idx_q + joint.nq]
        if joint.nq == 1:
            state[name] = float(part[0])
        elif joint.nq == 2 and joint.nv == 1:  # the cosine and the sine of a continuous joint
            state[name] = float(np.arctan2(part[1], part[0]))
    return state


def _of_mujoco(model: Any, qpos: Any) -> State:
    """Return positions of slides and hinges by joint, from all of a mujoco model, (nq,)."""
    single = [k for k in range(model.njnt) if int(model.jnt_type[k]) >= _FIRST_SINGLE_TYPE]
    return {model.joint(k).name: float(qpos[model.jnt_qposadr[k]]) for k in single}


def _key_frames(root: Element) -> Iterator[tuple[str, State]]:
    """Yield the key frames of an MJCF file whose `qpos` has all numbers of its joints."""
    names: list[str | None] = []
    for body in root.iterfind("worldbody"):
        for joint in body.iter():
            if joint.tag == "freejoint":
                names += [None] * _POSITIONS["free"]
            elif joint.tag == "joint":
                count = _POSITIONS.get(joint.get("type", "hinge"), 1)
                names += [joint.get("name") if count == 1 else None] * count
    for key in root.iterfind("keyframe/key"):
        numbers: list[float] = []
        with suppress(ValueError):
            numbers = [float(text) for text in key.get("qpos", "").split()]
        if key.get("name") and len(numbers) == len(names) and np.all(np.isfinite(numbers)):
            pairs = zip(names, numbers, strict=True)
            yield str(key.get("name")), {name: x for name, x in pairs if name is not None}
