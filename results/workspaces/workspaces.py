"""What failures leave of the workspaces of some arms, and the best limits."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from formulations.io.files import write_bytes
from formulations.io.study import Effort
from formulations.io.table import HIDDEN, column
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.read_robot import read_robot
from formulations.kinematics.serial_arm import Ranges, SerialArm
from formulations.plot.robots import draw_workspace
from formulations.plot.style import content
from formulations.workspaces.best_limits import STARTS, best_limits
from formulations.workspaces.workspace import Workspace, measured, workspace
from results.robots.survey import SurveyArm
from results.script import main, study_of
from results.workspaces.orders import SETTINGS, OrderRow, orders

#: Artificial limits of the planar 3R arm whose area is known, 0.355811.
_KNOWN: Ranges = tuple((-end, end) for end in np.deg2rad([20.0, 90.0, 90.0]).tolist())
_AS_GIVEN, _PHYSICAL = "as given", "physical limits"
_LIMITS, _LENGTHS = "best limits", "best limits and lengths"
# Arms in space whose link lengths are chosen, too.
_LENGTHENED = ("UR5",)
_ROBOTS = (
    SurveyArm(
        "Franka Panda", "panda_description/urdf/panda.urdf", "panda_hand_tcp", "position"
    ),
    SurveyArm("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", "position"),
)
_VOXELS = {"planar": 0.01, "Franka Panda": 0.02, "UR5": 0.03}


@dataclass(frozen=True)
class WorkspaceRow:
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
    percent_kept: float = field(metadata=column("% kept", ".3g"))
    fatal: str = field(metadata=column("keeps nothing if it locks", empty="–"))
    voxel: float = field(metadata=HIDDEN)
    passed_by_depth: Mapping[str, float] = field(metadata=HIDDEN)
    limits: Mapping[str, list[float]] = field(metadata=HIDDEN)
    links: Mapping[str, float] = field(metadata=HIDDEN)
    figure: str = field(metadata=HIDDEN)


def compute(effort: Effort, folder: Path) -> Iterator[WorkspaceRow | OrderRow]:
    """Yield a row for each workspace, which is drawn, and for each Jacobian of seven joints."""
    for arm, choice, result in chain(_planar(effort), _spatial(effort)):
        row = row_of(arm, choice, result)
        if row.figure:
            write_bytes(folder / row.figure, content(draw_workspace(result), "svg"))
        yield row
    yield from orders(effort, folder)


Judged = tuple[str, str, Workspace]


def _planar(effort: Effort) -> Iterator[Judged]:
    starts = effort.starts or STARTS
    for count in (3, 4):
        given = SerialArm.planar((1 / count,) * count)
        name = f"planar {count}R"
        for choice in (_AS_GIVEN, _LIMITS, _LENGTHS):
            effort.progress(f"{name}, {choice}")
            arm, limits = given, _KNOWN if count == 3 else (*_KNOWN, _KNOWN[-1])
            if choice != _AS_GIVEN:
                arm, limits = best_limits(
                    given,
                    _VOXELS["planar"],
                    lengths=choice == _LENGTHS,
                    starts=4 * starts,
                    seed=effort.seed,
                    progress=effort.progress,
                )
            yield name, choice, workspace(arm, limits, _VOXELS["planar"])


def _spatial(effort: Effort) -> Iterator[Judged]:
    starts = effort.starts or STARTS
    for robot in _ROBOTS:
        name, voxel = robot.name, _VOXELS[robot.name]
        arm = SerialArm.from_chain(chain_between(read_robot(robot.path), robot.tip))
        effort.progress(f"{name}, {_PHYSICAL}")
        physical = workspace(arm, arm.physical, voxel, progress=effort.progress)
        yield name, _PHYSICAL, physical
        search = partial(
            best_limits, voxel=voxel, starts=starts, seed=effort.seed, progress=effort.progress
        )
        _, limits = search(arm)
        yield name, _LIMITS, measured(physical.sets, limits, effort.progress)
        if name in _LENGTHENED:
            effort.progress(f"{name}, {_LENGTHS}")
            arm, limits = search(arm, lengths=True)
            yield name, _LENGTHS, workspace(arm, limits, voxel, progress=effort.progress)


def row_of(arm: str, choice: str, result: Workspace) -> WorkspaceRow:
    """Return a workspace as a row."""
    names = [step.name for step in result.arm.steps]
    depths = {str(k): share for k, share in enumerate(result.passed) if share == share}
    drawn = choice == _LIMITS
    return WorkspaceRow(
        arm=arm,
        choice=choice,
        dimension=result.dimension,
        method=str(result.to_dict()["method"]),
        size=result.size,
        error=result.error,
        raw=result.raw,
        without_failure=result.before,
        physical=result.physical,
        percent_kept=100 * result.size / result.physical,
        fatal=", ".join(result.critical),
        voxel=result.sets.voxel,
        passed_by_depth=depths,
        limits={k: [*map(float, ends)] for k, ends in zip(names, result.limits, strict=True)},
        links=dict(zip(names, result.arm.links.tolist(), strict=True)),
        figure=f"{arm.replace(' ', '-').lower()}.svg" if drawn else "",
    )


STUDY = study_of(
    __file__,
    title="what failures leave of workspaces, and the best limits",
    page="workspaces.md",
    tables={"workspaces": WorkspaceRow, "orders": OrderRow},
    takes="a quarter of an hour, matplotlib and packages of robots",
    compute=compute,
    settings=SETTINGS,
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
