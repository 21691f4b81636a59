"""One robot: a file or a model that is read once, its tool, its task, and what is around it.

::

    panda = lj.Robot("panda.urdf", tip="panda_hand", clearance=0.02, obstacles="cell.urdf")
    lj.measure(panda, q)
    lj.posture(panda, at=lj.Pose((0.4, 0.1, 0.5)))

What functions compute with follows from it: the `tree` of all links and joints, the `chain` of
joints from base to tip, the `arm` (the chain with its task and unit of length, J as a function
of the joints' positions), and what keeps links `apart`. Each is imported and made when it is
first asked for, so that this module loads fast.

The docstring of each parameter is also the help of a command's option: it does not speak of
Python.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, TypeVar

from lockedjoint.formulations.io.objects import takes
from lockedjoint.kinematics.in_degrees import FromDegrees, InDegrees, in_radians
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError, of_kind, printable

if TYPE_CHECKING:  # what computes is imported when a robot is made
    from lockedjoint.clearance.link_clearance import LinkClearance
    from lockedjoint.clearance.read_clearance import Obstacles
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.kinematics.description import Description, State
    from lockedjoint.kinematics.robot_arm import RobotArm
    from lockedjoint.kinematics.srdf import Srdf
    from lockedjoint.kinematics.tree import RobotTree
    from lockedjoint.nlp.arrays import FloatArray

# Distance in metres that links keep from obstacles, and from each other where there are
# obstacles, if `clearance` is not given.
_FROM_OBSTACLES_M = 0.005


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A robot, its tool and task, and the obstacles around it.

    `source` may also be a model that pinocchio, mujoco or yourdfpy has loaded. `locked` and
    `limits` may be `InDegrees`. After the robot is made, its fields hold what was read:
    `source` is a `Description`, `obstacles` an `Obstacles`, `srdf` an `Srdf`, and angles are
    radians.

    Parameters
    ----------
    source
        What describes the robot: a URDF file, an MJCF file, a Denavit–Hartenberg table (.csv),
        robot_descriptions:NAME (a robot of the package robot_descriptions), or example, an arm
        of seven joints in the package.
    tip
        The link that carries the tool, anywhere on the robot, and after a colon the point that
        is the tool, in the link's frame, in metres; by default the last link, if there is only
        one, and its origin.
    base
        The link relative to which the tool moves; it may be the other hand of a robot with two
        arms. By default it is the root.
    task
        The directions of the tool that count: all, position, orientation, or some of
        vx,vy,vz,wx,wy,wz. They are along the axes of the base, or with tip: before them, as in
        tip:vz, of the tip. By default all count, and along a path those that its waypoints
        state.
    length
        The characteristic length in metres: the unit in which all lengths are measured. By
        default it is the root mean square of the revolute joints' lever arms.
    point
        The point that is the tool, shape (3,), in metres, if `tip` does not state it.
    locked
        Joints that have locked, and where, in radians or metres; they have no column in the
        Jacobian.
    limits
        Narrower limits of joints than the file's, lower and upper, in radians or metres.
    clearance
        The distance in metres that links keep from each other and from obstacles; by default
        they may touch, or with obstacles 0.005. It needs coal, and the meshes that the URDF
        file names.
    obstacles
        Obstacles around the robot: a URDF file with fixed joints, or a mesh; in the frame of
        the base, or of the root if the base is another arm's hand.
    states
        Named configurations: positions by joint, by name. They are added to those of the files.
    srdf
        The SRDF file beside a URDF file, as MoveIt has it: planning groups, named states, and
        pairs of links whose distance is not checked.
    group
        The planning group of the SRDF file that moves. It states base and tip, unless you give
        them.

    Attributes
    ----------
    description
        The contents of the source, which is read once.
    chain
        The n free joints from base to tip.

    Raises
    ------
    FileError
        If a file cannot be read or does not describe a robot.
    InputError
        If a link or joint is unknown, a number is out of range, or nothing moves the tip.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> robot = lj.Robot("example", task="position")
    >>> robot
    <Robot example: 7 joints from base to tool, task vx,vy,vz>
    >>> robot.chain.names[:3]
    ('shoulder_pan', 'shoulder_lift', 'upper_arm_roll')
    """

    source: Any
    tip: str | None = None
    base: str | None = None
    task: TaskSpace | str | None = None
    length: float | None = None
    _: KW_ONLY
    point: Sequence[float] = (0.0, 0.0, 0.0)
    locked: Mapping[str, float] | InDegrees = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] | InDegrees = field(default_factory=dict)
    clearance: float | None = None
    obstacles: str | os.PathLike[str] | Obstacles | None = None
    states: Mapping[str, State] = field(default_factory=dict)
    srdf: str | os.PathLike[str] | Srdf | None = None
    group: str | None = None
    description: Description = field(init=False)
    chain: Chain = field(init=False)

    def __post_init__(self) -> None:
        from lockedjoint.kinematics.description import Description
        from lockedjoint.kinematics.srdf import Srdf
        from lockedjoint.kinematics.tip import chosen_tip

        self._check()
        described = Description.read(self.source)
        tip, point = self._tip_and_point(described.tree.links)
        base, srdf = self.base, self.srdf
        if srdf is not None and not isinstance(srdf, Srdf):
            srdf = Srdf.read(srdf)
        if self.group is not None:
            base, tip = self._ends_of_group(srdf, described.tree, tip)
        obstacles = self.obstacles
        if obstacles is not None:
            from lockedjoint.clearance.read_clearance import Obstacles

            if not isinstance(obstacles, Obstacles):
                obstacles = Obstacles.read(obstacles)
        # What was read replaces what was given; the dataclass is frozen, so not by assignment.
        kept: dict[str, Any] = {
            "source": described,
            "description": described,
            "tip": chosen_tip(described.tree, base) if tip is None else tip,
            "base": base,
            "srdf": srdf,
            "point": point,
            "task": TaskSpace.parse(self.task) if isinstance(self.task, str) else self.task,
            "obstacles": obstacles,
            "states": {
                **described.states,
                **({} if srdf is None else srdf.states_of(self.group)),
                **self.states,
            },
        }
        for name in ("locked", "limits"):
            kept[name] = self._in_radians(getattr(self, name), described.tree)
        for name, value in kept.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "chain", self.with_locked({}))

    def _check(self) -> None:
        """Raise InputError if a field has a value of a wrong kind."""
        for name in ("tip", "base"):
            of_kind(name, getattr(self, name), (str, type(None)), "the name of a link")
        of_kind("group", self.group, (str, type(None)), "the name of a planning group")
        for name in ("locked", "limits", "states"):
            given = getattr(self, name)
            if name != "states" and isinstance(given, InDegrees):
                given = given.stated
            of_kind(name, given, Mapping, "a mapping from names")
        allowed = "a TaskSpace, or its directions as text"
        of_kind("task", self.task, (str, TaskSpace, type(None)), allowed)
        given = self.clearance
        if given is not None and not (isinstance(given, int | float) and 0 < given < math.inf):
            raise InputError("clearance", given, "a finite number above 0, in metres")

    def _ends_of_group(
        self, srdf: Srdf | None, tree: RobotTree, tip: str | None
    ) -> tuple[str, str]:
        """Return the links at base and tip: those that are given, or the planning group's.

        InputError if there is no SRDF file, or it has no such group.
        """
        from lockedjoint.kinematics.planning_group import planning_group

        if srdf is None:
            raise InputError("group", self.group, "a group only with an SRDF file")
        stated: Any = self.locked.stated if isinstance(self.locked, InDegrees) else self.locked
        chosen = planning_group(srdf, str(self.group), tree, tip, stated)
        return chosen.base if self.base is None else self.base, chosen.tip

    def _tip_and_point(self, links: Sequence[str]) -> tuple[str | None, Sequence[float]]:
        """Return the tip's link, and the point after its name, in metres, or `point`."""
        if self.tip is None or self.tip in links or ":" not in self.tip:
            return self.tip, self.point
        link, _, place = self.tip.rpartition(":")
        try:
            x, y, z = map(float, place.split(","))
        except ValueError:  # other texts, or another count
            allowed = "LINK, or LINK:X,Y,Z with a point of the link, in metres"
            raise InputError("tip", self.tip, allowed) from None
        return link, (x, y, z)

    @classmethod
    def of(cls, robot: object) -> Robot:
        """Return a robot, or the one that something makes: a file, a model, a description.

        Raises
        ------
        InputError
            If it makes none. An arm or a chain does not: it has only the joints, while a robot
            also has the links around them.
        """
        if isinstance(robot, Robot):
            return robot
        if is_part(robot):
            allowed = "a Robot, of which that is a part, or what makes one: its file or a model"
            raise InputError("robot", f"of type {type(robot).__name__}", allowed)
        return cls(robot)

    def changed(self, **others: Any) -> Robot:
        """Return the robot with other fields; its file is not read again.

        Raises
        ------
        InputError
            If it has no such field, or a value is not allowed.
        """
        _check_known(type(self), others)
        srdf: Any = self.srdf
        if srdf is not None and others.keys() & {"srdf", "group"}:
            # Ends that the file or the group stated before hold no more.
            before = srdf.states_of(self.group)
            states = {k: v for k, v in self.states.items() if before.get(k) != v}
            ends = {} if self.group is None else {"tip": None, "base": None}
            others = {"states": states, **ends, **others}
        return replace(self, **others)

    @takes("positions by the names of joints")
    def with_locked(self, locked: Mapping[str, float]) -> Chain:
        """Return the chain of joints that are left when others lock, too.

        `locked` has positions by joint, radians or metres, beside the robot's own `locked`.
        """
        from lockedjoint.kinematics.chain import TWO_TURNS, narrowed
        from lockedjoint.kinematics.chain_between import chain_between

        own: Any = self.locked
        fixed = {**own, **locked}
        tip = str(self.tip)
        chain = chain_between(self.tree, tip, self.base, fixed, self.point, "locked joint")
        given: Any = self.limits
        limits = {name: ends for name, ends in given.items() if name not in fixed}
        chain = narrowed(chain, limits, "limits")
        # Positions that look like degrees get a remark.
        far = [
            f"{name} at {at:g}"
            for name, at in own.items()
            if not (name in self.slides or isinstance(at, FromDegrees)) and abs(at) > TWO_TURNS
        ]
        said = [
            f"Locked positions beyond two turns (±4π rad) may be degrees: {', '.join(far)}."
            for _ in far[:1]
        ]
        obstacles: Any = self.obstacles
        said += () if obstacles is None else obstacles.notes
        return replace(chain, remarks=(*chain.remarks, *said, *self._of_srdf))

    @cached_property
    def _of_srdf(self) -> tuple[str, ...]:
        """Sentences on what was read of the SRDF file, and on what was left aside."""
        from lockedjoint.kinematics.srdf_notes import srdf_notes

        srdf: Any = self.srdf
        if srdf is None:
            return ()
        return srdf_notes(
            srdf, self.tree, self.group, str(self.base or self.tree.root), str(self.tip)
        )

    @property
    def name(self) -> str:
        """Its name in the file."""
        return self.tree.name

    @property
    def slides(self) -> list[str]:
        """Names of its prismatic joints, whose positions are in metres."""
        return _slides(self.tree)

    @property
    def tree(self) -> RobotTree:
        """All of its links and joints."""
        return self.description.tree

    @cached_property
    def arm(self) -> RobotArm:
        """J as a function of the joints' positions; InputError unless the arm is redundant."""
        from lockedjoint.kinematics.robot_arm import RobotArm

        task = self.task if isinstance(self.task, TaskSpace) else TaskSpace()
        return RobotArm(self.chain, task, self.length)

    @cached_property
    def apart(self) -> LinkClearance | None:
        """What keeps links apart; None if they may touch."""
        return self.apart_along(self.chain)

    @takes("the chain of the robot, or of what is left of it")
    def apart_along(self, chain: Chain) -> LinkClearance | None:
        """Return what keeps links apart if these joints move; None if they may touch."""
        if self.clearance is None and self.obstacles is None:
            return None
        from lockedjoint.clearance.read_clearance import read_clearance

        least = _FROM_OBSTACLES_M if self.clearance is None else self.clearance
        obstacles: Any = self.obstacles
        srdf: Any = self.srdf
        may_touch = None if srdf is None else srdf.may_touch
        return read_clearance(self.description, chain, least, obstacles, may_touch)

    def configuration(self, q: Any = None) -> tuple[FloatArray, tuple[str, ...]]:
        """Return positions of the free joints, shape (n,), and notes on what was left aside.

        Parameters
        ----------
        q
            What states a configuration, see `lockedjoint.kinematics.state`; by default midway
            between the limits.

        Raises
        ------
        InputError
            If joints are missing, or a position is outside its limits.
        """
        from lockedjoint.kinematics.state import read_state

        return read_state(q, self.chain, self.states, self.slides)

    @takes("positions or limits by the names of joints, or InDegrees of these")
    def in_radians(self, stated: Any) -> Any:
        """Return positions or limits by joint, in radians or metres; `InDegrees` are converted.

        Raises
        ------
        InputError
            If something is no number.
        """
        return self._in_radians(stated, self.tree)

    @staticmethod
    def _in_radians(stated: Any, tree: RobotTree) -> Any:
        """Return values by joint; degrees of revolute joints become radians."""
        return (
            in_radians(stated.stated, _slides(tree))
            if isinstance(stated, InDegrees)
            else stated
        )

    def __repr__(self) -> str:
        """Say in one line which robot it is, and what is asked of it."""
        chain = self.chain
        parts = [f"{len(chain.joints)} joints from {chain.base} to {chain.tip}"]
        if isinstance(self.task, TaskSpace):
            parts.append(f"task {','.join(self.task.directions)}")
        if self.group is not None:
            parts.append(f"group {self.group}")
        parts += [f"{name} locked at {at:g}" for name, at in chain.locked_at]
        if self.length is not None:
            parts.append(f"length {self.length:g} m")
        if self.clearance is not None:
            parts.append(f"clearance {self.clearance:g} m")
        obstacles: Any = self.obstacles
        if obstacles is not None:
            parts.append(f"{len(obstacles.bodies)} obstacles")
        return f"<Robot {printable(self.name)}: {printable(', '.join(parts))}>"

    def _repr_html_(self) -> str:
        """Return the line, a drawing, a table of the joints, and notes, for notebooks."""
        from lockedjoint.kinematics.sketch import sketch

        chain = self.chain
        heads = ("joint", "lower", "upper", "velocity", "unit")
        rows = [
            (joint.name, *map(_shown, (joint.lower, joint.upper, joint.velocity)), joint.unit)
            for joint in chain.joints
        ]
        cells = ["".join(f"<td>{escape(printable(x))}</td>" for x in row) for row in rows]
        head = "".join(f"<th>{name}</th>" for name in heads)
        table = "".join(f"<tr>{row}</tr>" for row in cells)
        notes = "".join(f"<li>{escape(printable(note))}</li>" for note in chain.notes)
        states = ", ".join(map(printable, self.states))
        srdf: Any = self.srdf
        groups = "" if srdf is None else ", ".join(map(printable, srdf.groups))
        return (
            f"<p>{escape(repr(self))}</p>{sketch(chain, chain.mid_range)}"
            f"<table><tr>{head}</tr>{table}</table>"
            + (f"<p>groups: {escape(groups)}</p>" if groups else "")
            + (f"<p>states: {escape(states)}</p>" if states else "")
            + (f"<ul>{notes}</ul>" if notes else "")
        )


def _slides(tree: RobotTree) -> list[str]:
    """Return the names of the prismatic joints."""
    return [joint.name for joint in tree.joints if joint.type == "prismatic"]


def is_part(given: object) -> bool:
    """Whether something is the arm of a robot, or its chain of joints."""
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.kinematics.robot_arm import RobotArm

    return isinstance(given, RobotArm | Chain)


def _shown(limit: float) -> str:
    """Return a limit as text; "none" if it is infinite."""
    return f"{limit:.4g}" if math.isfinite(limit) else "none"


Settings = TypeVar("Settings")


def with_settings(
    kind: type[Settings], given: Settings | None, settings: Mapping[str, Any]
) -> Settings:
    """Return a search, such as `Search`, with some of its fields changed.

    Parameters
    ----------
    kind
        The dataclass of the search.
    given
        A search of this kind; None for one with all defaults.
    settings
        Values of fields, by name, in place of those of the search.

    Raises
    ------
    InputError
        If it is of another kind, or has no such field.
    """
    if given is not None:
        of_kind("search", given, kind, f"a {kind.__name__}")
    _check_known(kind, settings)
    return kind(**settings) if given is None else replace(given, **settings)  # type: ignore[type-var]


def _check_known(kind: type[Any], given: Mapping[str, Any]) -> None:
    """Raise InputError unless a dataclass has all of these fields."""
    known = [one.name for one in fields(kind) if one.init]
    for name in given:
        if name not in known:
            raise InputError("argument", name, f"one of {', '.join(known)}")
