"""What failures leave of the workspaces of some arms, and the best limits, as a study."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from formulations.figures.workspace import draw
from formulations.files.figure import content, figure_class
from formulations.files.table import HIDDEN, column
from formulations.robots.best_limits import STARTS, best_limits
from formulations.robots.chain_between import chain_between
from formulations.robots.read_urdf import read_urdf
from formulations.robots.serial_arm import Ranges, SerialArm
from formulations.robots.workspace import Workspace, measured
from formulations.robots.workspace import workspace as found_workspace
from formulations.studies.robots import SurveyArm
from formulations.studies.study import Effort, Part, Study

#: Artificial limits of the planar 3R arm whose area is known, 0.355811.
KNOWN: Ranges = tuple((-one, one) for one in np.deg2rad([20.0, 90.0, 90.0]).tolist())
_AS_GIVEN, _PHYSICAL = "as given", "physical limits"
_LIMITS, _LENGTHS = "best limits", "best limits and lengths"
_VOXELS = {"planar": 0.01, "Franka Panda": 0.02, "UR5": 0.03}


@dataclass(frozen=True)
class Row:
    """One arm with one choice of artificial limits: the columns of ``workspaces.csv``.

    Attributes
    ----------
    arm, choice
        The arm, and how its limits, and its links if it says so, were chosen.
    dimension
        2 for areas in m², 3 for volumes in m³.
    method
        Closed form or grid.
    size, error
        Of the failure-tolerant workspace.
    raw
        Of all voxels, which over-estimate.
    without_failure, physical
        What is reached within the artificial and within the physical limits.
    percent_kept
        Of what is reached within the physical limits.
    fatal
        Joints whose failures alone leave nothing.
    voxel
        Edge of a voxel in metres.
    passed_by_depth
        Share of sampled points that pass inverse kinematics, by layers below the surface.
    limits, links
        Artificial limits and link lengths by joint.
    figure
        File of the drawing, if there is one.
    """

    arm: str
    choice: str
    dimension: int = field(metadata=HIDDEN)
    method: str
    size: float = field(metadata=column("kept", ".4g"))
    error: float = field(metadata=column("error", ".2g"))
    raw: float = field(metadata=column("raw voxels", ".4g"))
    without_failure: float = field(metadata=column("no failure", ".4g"))
    physical: float = field(metadata=column("physical limits", ".4g"))
    percent_kept: float = field(metadata=column("% kept", ".1f"))
    fatal: str = field(metadata=column("keeps nothing if it locks", empty="–"))
    voxel: float = field(metadata=HIDDEN)
    passed_by_depth: Mapping[str, float] = field(metadata=HIDDEN)
    limits: Mapping[str, list[float]] = field(metadata=HIDDEN)
    links: Mapping[str, float] = field(metadata=HIDDEN)
    figure: str = field(metadata=HIDDEN)


def study() -> Study:
    """Return the study."""
    return Study(
        name="workspaces",
        title="what failures leave of workspaces, and the best limits",
        page="workspaces.md",
        template="workspaces.md.j2",
        tables={"workspaces": Row},
        command="lockedjoint report --only workspaces --out results",
        takes="two minutes, matplotlib and packages of robots",
        compute=_compute,
        long=True,
        check=_check,
    )


def _check() -> None:
    figure_class()
    for one in _robots():
        assert one.path


def _robots() -> tuple[SurveyArm, ...]:
    folder = "panda_description/urdf/panda.urdf"
    return (
        SurveyArm("Franka Panda", folder, "panda_hand_tcp", "position"),
        SurveyArm("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", "position"),
    )


def _compute(effort: Effort, _: Path) -> Iterator[Part]:
    starts = effort.starts or STARTS
    for count in (3, 4):
        arm = SerialArm.planar((1 / count,) * count)
        name = f"planar {count}R"
        for choice in (_AS_GIVEN, _LIMITS, _LENGTHS):
            effort.progress(f"{name}, {choice}")
            chosen, limits = arm, KNOWN if count == 3 else (*KNOWN, KNOWN[-1])
            if choice != _AS_GIVEN:
                chosen, limits = best_limits(
                    arm,
                    _VOXELS["planar"],
                    lengths=choice == _LENGTHS,
                    starts=4 * starts,
                    seed=effort.seed,
                    progress=effort.progress,
                )
            yield _part(name, choice, found_workspace(chosen, limits, _VOXELS["planar"]))
    for one in _robots():
        arm = SerialArm.from_chain(chain_between(read_urdf(one.path), one.tip))
        voxel = _VOXELS[one.name]
        effort.progress(f"{one.name}, {_PHYSICAL}")
        found = found_workspace(arm, arm.physical, voxel, progress=effort.progress)
        yield _part(one.name, _PHYSICAL, found)
        arm, limits = best_limits(
            arm, voxel, starts=starts, seed=effort.seed, progress=effort.progress
        )
        yield _part(one.name, _LIMITS, measured(found.sets, limits, effort.progress))


def _part(arm: str, choice: str, found: Workspace) -> Part:
    row = row_of(arm, choice, found)
    files = {row.figure: content(draw(found), "svg")} if row.figure else {}
    return Part(rows=[row], files=files)


def row_of(arm: str, choice: str, found: Workspace) -> Row:
    """Return a workspace as a row."""
    names = [one.name for one in found.arm.steps]
    depths = {str(k): one for k, one in enumerate(found.passed) if one == one}
    drawn = choice == _LIMITS
    return Row(
        arm=arm,
        choice=choice,
        dimension=found.dimension,
        method=str(found.to_dict()["method"]),
        size=found.size,
        error=found.error,
        raw=found.raw,
        without_failure=found.before,
        physical=found.physical,
        percent_kept=100 * found.size / found.physical,
        fatal=", ".join(found.fatal),
        voxel=found.sets.voxel,
        passed_by_depth=depths,
        limits={k: [float(x) for x in one] for k, one in zip(names, found.limits, strict=True)},
        links=dict(zip(names, found.arm.links.tolist(), strict=True)),
        figure=f"{arm.replace(' ', '-').lower()}.svg" if drawn else "",
    )
