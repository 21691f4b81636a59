"""What failures leave of a robot's workspace: measured, made largest, or proved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.chain import Chain, check_named
from lockedjoint.kinematics.in_degrees import FromDegrees, InDegrees, far_angles
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    is_planar,
    link_lengths,
    physical_ranges,
    serial_chain,
)
from lockedjoint.nlp.arrays import FloatArray, as_floats, real_number
from lockedjoint.nlp.errors import InputError, one_of
from lockedjoint.nlp.executors import LocalExecutor, default_workers
from lockedjoint.nlp.progress import part_of
from lockedjoint.robot import Robot, with_settings
from lockedjoint.workspaces.best_limits import best_limits
from lockedjoint.workspaces.guaranteed import guaranteed_workspace
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.pose_sets import PoseSets
from lockedjoint.workspaces.workspace import Workspace, check_limits, measured
from lockedjoint.workspaces.workspace import workspace as workspace_of
from lockedjoint.workspaces.workspace_search import CubeSearch, WorkspaceSearch

#: Limits are lower and upper limits of joints by name, radians or metres.
Limits = Mapping[str, tuple[float, float]]
# The sum of the links is so many voxels long.
_VOXELS_PER_ARM = 50
# The sum of the links is so many voxels long if the tool keeps an orientation in space.
_VOXELS_PER_ARM_IN_SPACE = 12
# The smallest cubes are, by default, so many times smaller than the sum of the links.
_CUBES_PER_ARM = 100
# Angles of an orientation may be this large.
_LARGEST_ANGLE_RAD = 100.0
# The user may have these optimised.
_OPTIMISED = ("limits", "lengths")


def workspace(
    robot: object,
    search: WorkspaceSearch | None = None,
    *,
    limits: Limits | InDegrees | None = None,
    orientation: Sequence[float] | None = None,
    optimise: str | None = None,
    progress: Callable[[str], None] = lambda _: None,
    **settings: Any,
) -> Workspace:
    """Measure the workspace that is kept whichever joint locks, or maximise it.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one. Configurations in which its links are too near each other
        or obstacles do not count.
    search
        How finely to look.
    limits
        Artificial limits of joints, radians or metres (or `InDegrees`), which hold until a
        joint locks; by default the physical limits.
    orientation
        Orientation at which the tool is held: roll, pitch and yaw in radians about fixed axes
        of the base, or a quaternion, scalar last. For planar arms of four joints or more and
        others of seven or more; by default free.
    optimise
        ``"limits"``: choose the artificial limits that keep the most; ``"lengths"``: also the
        lengths of the links, with the same sum.
    progress
        A function that is told what is being done.
    **settings
        Fields of `WorkspaceSearch`, in place of those of the search.

    Raises
    ------
    InputError
        If a joint is unknown, limits are outside the physical ones or given where they are to
        be chosen, or the arm cannot be measured so.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> kept = lj.workspace("example", voxel=0.1, slice_degrees=30)
    >>> kept.critical
    ('elbow',)
    """
    given, chosen = Robot.of(robot), with_settings(WorkspaceSearch, search, settings)
    own: Limits | None = None if limits is None else given.in_radians(limits)
    if optimise is not None:
        one_of("optimise", optimise, _OPTIMISED)
        if own:
            raise InputError("limits", ", ".join(own), "none where they are to be chosen")
    arm = serial_chain(given.chain)
    for what, where in ((orientation, "an orientation"), (given.apart, "a clearance")):
        if optimise == "lengths" and what is not None:
            raise InputError("optimise", optimise, f"limits with {where}")
    ranges = limits_of(own, arm)
    check_limits(arm, ranges)
    rotation = None if orientation is None else _rotation(orientation)
    edge = chosen.voxel or _edge(arm, rotation is not None)
    step, sets = radians(chosen.slice_degrees), None
    choosing, measuring = progress, progress
    if optimise is not None or rotation is not None:  # each takes about half of the time
        choosing, measuring = part_of(progress, 0.0, 0.5), part_of(progress, 0.5, 1.0)
    if rotation is not None:
        sets = PoseSets(arm, rotation, edge, step, choosing, chosen.seed, clearance=given.apart)
    if optimise is not None:
        arm, ranges = best_limits(
            arm,
            edge,
            lengths=optimise == "lengths",
            least_width=radians(chosen.least_width_degrees),
            starts=chosen.starts,
            seed=chosen.seed,
            progress=choosing if sets is None else progress,
            sets=sets,
        )
    if sets is not None and orientation is not None:
        stated = as_floats("orientation", orientation).tolist()
        notes = far_angles("orientation", stated, "multiply by π/180")
        return replace(measured(sets, ranges, measuring), notes=notes)
    return workspace_of(arm, ranges, edge, step, measuring, given.apart, chosen.seed)


@dataclass(frozen=True, eq=False)
class ProvedWorkspace:
    """What is proved of a workspace.

    Attributes
    ----------
    arm, limits
        The arm and its artificial limits.
    cubes
        Cubes that are kept for certain; None if nothing was proved.
    complete
        Whether the search ended; if not, the user interrupted it.
    """

    arm: Chain
    limits: Ranges
    cubes: KeptCubes | None
    complete: bool

    @property
    def size(self) -> float:
        """Area or volume that is kept for certain, in m² or m³."""
        return self.cubes.size if self.cubes else 0.0

    def __repr__(self) -> str:
        """Say in one line how much is kept for certain."""
        count = len(self.cubes.half_width) if self.cubes else 0
        unit = "m²" if is_planar(self.arm) else "m³"
        return f"<ProvedWorkspace: {self.size:.4g} {unit} kept for certain, {count} cubes>"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        cubes, names = self.cubes, [joint.name for joint in self.arm.joints]
        return {
            "kept_for_certain": self.size,
            "unit": "m²" if is_planar(self.arm) else "m³",
            "cubes": len(cubes.half_width) if cubes else 0,
            "edges": sorted({2 * width for width in cubes.half_width.tolist()})
            if cubes
            else [],
            "kind": "proved, rounding errors included",
            "complete": self.complete,
            "limits": {k: list(v) for k, v in zip(names, self.limits, strict=True)},
        }


def prove_workspace(
    robot: object,
    search: CubeSearch | None = None,
    *,
    limits: Limits | InDegrees | None = None,
    workers: int | None = None,
    progress: Callable[[str], None] = lambda _: None,
    **settings: Any,
) -> ProvedWorkspace:
    r"""Prove that cubes of positions are kept, whichever joint locks and wherever.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one. Collisions are not checked.
    search
        How small the cubes are.
    limits
        Artificial limits of joints, radians or metres (or `InDegrees`), which hold until a
        joint locks; by default the physical limits.
    workers
        Worker processes; by default one per core.
    progress
        A function that is told how far it is.
    **settings
        Fields of `CubeSearch`, in place of those of the search.

    Returns
    -------
    ProvedWorkspace
        After Ctrl-C what was proved until then.

    Raises
    ------
    InputError
        If a joint is unknown, a limit is outside the physical ones, or cubes are too many.

    Examples
    --------
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> lines = ["# convention: standard", "kind,a,alpha_rad,d,theta_rad"]
    >>> lines += ["revolute,1,0,0,0"] * 3
    >>> _ = Path("planar.csv").write_text("\n".join(lines))
    >>> limits = {"joint_1": (-0.3, 0.3), "joint_2": (0.6, 1.9), "joint_3": (0.6, 1.9)}
    >>> kept = lj.prove_workspace("planar.csv", limits=limits, finest=0.1, workers=1)
    >>> kept.size > 0.5
    True
    """
    given, chosen = Robot.of(robot), with_settings(CubeSearch, search, settings)
    arm = serial_chain(given.chain)
    ranges = limits_of(None if limits is None else given.in_radians(limits), arm)
    finest = chosen.finest or float(sum(link_lengths(arm))) / _CUBES_PER_ARM
    parts: list[KeptCubes] = []
    complete = False
    with LocalExecutor(workers or default_workers()) as executor:
        how: dict[str, Any] = {"executor": executor, "progress": progress}
        found: Iterator[KeptCubes]
        found = guaranteed_workspace(arm, ranges, finest / 2, chosen.halvings, **how)
        try:
            parts.extend(found)
            complete = True
        except KeyboardInterrupt:  # what is proved is kept
            pass
    cubes = KeptCubes.joined(parts) if parts else None
    return ProvedWorkspace(arm, ranges, cubes, complete)


def limits_of(limits: Limits | None, arm: Chain) -> Ranges:
    """Return the limits of all joints of an arm: those that are given, else the physical."""
    ranges = dict(zip(arm.names, physical_ranges(arm), strict=True))
    for name, ends in (limits or {}).items():
        check_named("joint of limits", name, list(ranges))
        pair = as_floats(f"limits of {name}", ends)
        if pair.shape != (2,):
            raise InputError(f"limits of {name}", ends, "a lower and an upper limit")
        allowed = "a finite number, radians or metres"
        low, high = (real_number(f"limits of {name}", end, allowed) for end in pair.tolist())
        # The unit in which the limits were stated is kept for errors.
        stated = FromDegrees if isinstance(ends[0], FromDegrees) else float
        ranges[name] = stated(low), stated(high)
    return tuple(ranges.values())


def _edge(arm: Chain, oriented: bool) -> float:
    coarse = oriented and (not is_planar(arm) or len(arm.joints) > 4)
    travel = sum(joint.upper - joint.lower for joint in arm.joints if joint.prismatic)
    return float(sum(link_lengths(arm)) or travel) / (
        _VOXELS_PER_ARM_IN_SPACE if coarse else _VOXELS_PER_ARM
    )


def _rotation(orientation: Sequence[float]) -> FloatArray:
    values = as_floats("orientation", orientation)
    if values.shape == (3,) and np.all(np.abs(values) <= _LARGEST_ANGLE_RAD):
        return np.asarray(Rotation.from_euler("xyz", values).as_matrix())
    if values.shape == (4,) and abs(np.linalg.norm(values) - 1) < 1e-6:
        return np.asarray(Rotation.from_quat(values).as_matrix())
    shown = ",".join(f"{value:g}" for value in values.ravel())
    allowed = "roll, pitch and yaw in radians, or a quaternion of length 1, scalar last"
    raise InputError("orientation", shown, allowed)
