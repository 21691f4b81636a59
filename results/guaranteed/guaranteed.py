"""Workspaces that are kept for certain, beside those that were sampled.

What comes in: arms and their best limits, from ``workspaces.csv`` of results/workspaces. What
goes out: ``guaranteed.csv``, a `GuaranteedRow` for each case: the area or volume of cubes that
the tool is proved to reach after any one joint locks; ``over-time.csv``, a `ProgressRow` for
each moment of one case; files of cubes and figures. A case is a line of `_CASES`: smaller cubes
prove more, and take longer.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lockedjoint.figures.robots import draw_kept
from lockedjoint.formulations.io.table import column, read_rows, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.serial_chain import planar_chain, serial_chain, with_links
from lockedjoint.nlp.executors import LocalExecutor, default_workers
from lockedjoint.workspaces.guaranteed import guaranteed_workspace
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.workspace import workspace
from results.script import main, save, study_of
from results.workspaces.workspaces import ROBOTS, WorkspaceRow


class _Case(NamedTuple):
    """An arm and a choice of limits, by their names in results/workspaces."""

    arm: str
    choice: str
    #: Full edge of the smallest cubes, in metres.
    edge_m: float
    #: Number of times that the largest cubes are halved.
    halvings: int


_CASES = (
    _Case("planar 3R", "best limits", 1 / 512, 5),
    _Case("planar 4R", "best limits", 1 / 256, 4),
    _Case("UR5", "best limits and lengths", 0.015, 2),
    _Case("UR5", "best limits and lengths", 0.0075, 3),
    _Case("Franka Panda", "best limits", 0.015, 2),
)
# The case of which the page shows how the volume grows.
_OVER_TIME = ("UR5", 0.0075)
# Bytes of a file of cubes that is kept beside the page.
_LARGEST = 1_000_000


@dataclass(frozen=True)
class GuaranteedRow:
    """One arm with one choice of limits: the columns of ``guaranteed.csv``.

    `proved` is the size of the cubes that are kept for certain, `cubes` of them, with the
    smallest full `edge`; `sampled` the size that sampling finds, with its `error`. Sizes are
    in m² in the plane and in m³ in space.
    """

    arm: str
    choice: str
    edge: float = field(metadata=column("smallest edge (m)", ".3g"))
    cubes: int
    proved: float = field(metadata=column("proved", ".4g"))
    sampled: float = field(metadata=column("sampled", ".4g"))
    error: float = field(metadata=column("its error", ".2g"))
    percent: float = field(metadata=column("proved, % of sampled", ".1f"))
    seconds: float = field(metadata=column("time (s)", ".0f"))
    workers: int


@dataclass(frozen=True)
class ProgressRow:
    """What a run had proved after so many seconds: the columns of ``over-time.csv``."""

    arm: str
    edge: float = field(metadata=column("smallest edge (m)", ".3g"))
    seconds: float = field(metadata=column("time (s)", ".0f"))
    proved: float = field(metadata=column("proved", ".4g"))
    percent: float = field(metadata=column("proved, % of sampled", ".1f"))


def compute(effort: Effort, folder: Path) -> Iterator[GuaranteedRow | ProgressRow]:
    """Yield a row for each arm; its cubes are drawn and written, for `lockedjoint verify`."""
    known = read_rows(Path(__file__).parents[1] / "workspaces" / "workspaces.csv", WorkspaceRow)
    workers = effort.workers or default_workers()
    for name, choice, edge, halvings in _CASES:
        row = next(row for row in known if (row.arm, row.choice) == (name, choice))
        limits = tuple((low, high) for low, high in row.limits.values())
        arm = _arm(row)
        sampled = workspace(arm, limits, row.voxel, progress=effort.progress)
        began = time.perf_counter()
        with LocalExecutor(workers) as executor:
            parts = guaranteed_workspace(
                arm,
                limits,
                finest=edge / 2,
                levels=halvings,
                seed=effort.seed,
                executor=executor,
                progress=effort.progress,
            )
            found, times = [], []
            for part in parts:
                found.append(part)
                times.append(time.perf_counter() - began)
            cubes = KeptCubes.joined(found)
        ended = time.perf_counter()
        place = folder / name.lower().replace(" ", "-")
        save(draw_kept(cubes), place.with_suffix(".svg"))
        if len(content := cubes.to_bytes()) < _LARGEST:
            place.with_suffix(".npz").write_bytes(content)
        yield row_from(
            GuaranteedRow,
            row,
            edge=float(2 * np.min(cubes.half_width)),
            cubes=len(cubes.half_width),
            proved=cubes.size,
            sampled=sampled.size,
            error=sampled.error,
            percent=100 * cubes.size / sampled.size,
            seconds=ended - began,
            workers=workers,
        )
        if (name, edge) == _OVER_TIME:
            sizes = [part.size for part in found]
            yield from _over_time(name, edge, times, sizes, sampled.size)


def _over_time(
    arm: str, edge: float, times: list[float], sizes: list[float], sampled: float
) -> Iterator[ProgressRow]:
    """Yield when each tenth of the sampled size was proved, and all that was.

    Sampling has an error: what is proved may be more than it finds, so that the tenths go on to
    19 of them.
    """
    proved = np.cumsum(sizes)
    steps = np.unique(np.searchsorted(proved, sampled * np.arange(1, 20) / 10))
    for at in [*steps[steps < len(proved) - 1], len(proved) - 1]:
        now = float(proved[at])
        yield ProgressRow(arm, edge, times[at], now, 100 * now / sampled)


def _arm(row: WorkspaceRow) -> Chain:
    """Return the arm of a row of results/workspaces."""
    links = list(row.links.values())
    robot = next((robot for robot in ROBOTS if robot.name == row.arm), None)
    if robot is None:
        return planar_chain(links)
    arm = serial_chain(chain_between(read_robot(robot.path), robot.tip))
    return with_links(arm, links)


STUDY = study_of(
    __file__,
    compute,
    tables={"guaranteed": GuaranteedRow, "over-time": ProgressRow},
    title="workspaces that are kept for certain",
    takes="an hour, matplotlib and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
