"""``lockedjoint workspace`` and ``prove-workspace``: what failures leave of the workspace.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.output import INTERRUPTED, Answer, as_text
from lockedjoint.commands.shared import (
    PICTURES,
    BareRobot,
    Outputs,
    RobotReach,
    check_style,
    checked_effort,
    draw,
    source_file,
)
from lockedjoint.kinematics.in_degrees import far_angles
from lockedjoint.workspaces.workspace_search import CubeSearch, WorkspaceSearch

if TYPE_CHECKING:
    from lockedjoint.workspaces.workspace import Workspace


def workspace(
    robot: RobotReach,
    limits: Mapping[str, tuple[float, float]] | None = None,
    orientation: list[float] | None = None,
    optimise: str | None = None,
    effort: Mapping[str, Any] | None = None,
    out: list[Path] | None = None,
    figure_style: Path | None = None,
) -> Answer:
    """Measure the workspace that is kept whatever joint fails, or make it largest.

    A position is kept if the arm reaches it within the artificial limits, and with any joint
    locked anywhere within its artificial limits and the others within their physical limits.
    The orientation of the tool is free without --orientation. The first command to try is with
    --optimise limits: within the physical limits alone, many arms keep nothing. With
    --clearance or --obstacles configurations in which links are too near do not count. With a
    free orientation only the size and its error heed this; the voxels do not.

    Parameters
    ----------
    orientation
        Hold the tool at this orientation: roll,pitch,yaw in radians about fixed axes of the
        base, or qx,qy,qz,qw. For planar arms of four joints or more and others of seven or
        more; by default free.
    optimise
        What is chosen so that the most is kept: limits, the artificial limits; lengths, these
        and the link lengths, with the same sum.
    effort
        How much is tried. May be repeated: voxel, the edge of the grid's cells in metres (a
        fiftieth of the sum of the links, or of the travel where there are none; a twelfth with
        --orientation in space or joints to spare), slice_degrees between the angles at which a
        joint may lock (5), least_width_degrees of limits that are chosen (10), starts of the
        search for limits (4), seed of the points that are sampled, and of all searches (0).
    out
        The file that is written: the result in .json, the kept voxels with a point of each in
        .npz, their surface in .ply, for `view --beside` and Blender, or a picture in .svg, .png
        or .pdf. May be repeated.
    """
    from lockedjoint.figures.robots import draw_workspace
    from lockedjoint.formulations.io.files import write_bytes
    from lockedjoint.workspaces.of_robot import workspace as workspace_of

    endings = (".json", ".npz", ".ply", *PICTURES)
    files = Outputs.checked(out, endings, [source_file(robot), figure_style])
    check_style(figure_style, files.picture is not None, "one with a picture as --out")
    tried = checked_effort(effort, WorkspaceSearch)
    chosen: Any = {"optimise": optimise, "progress": progress, **tried}
    result = workspace_of(robot, limits=limits, orientation=orientation, **chosen)
    parts = {files.of(".npz"): result.points_file, files.of(".ply"): result.mesh_file}
    wanted = [path for path in parts if path is not None]
    values, text = result.to_dict(), _text(result)

    def picture() -> None:
        draw(files.picture, figure_style, lambda: draw_workspace(result))

    notes = (*robot.chain.notes, *(() if robot.apart is None else robot.apart.notes))
    notes += far_angles("--orientation", orientation or ())
    if wanted and not result.size:
        names = " and ".join(map(str, wanted))
        failure = [f"Nothing is kept, so that {names} was not written."]
        json = files.of(".json")
        return Answer(values, text, json, notes, failure=failure, status=1, draw=picture)
    for path in wanted:
        write_bytes(path, parts[path]())
    return Answer(values, text, files.of(".json"), notes, draw=picture)


def prove_workspace(
    robot: BareRobot,
    limits: Mapping[str, tuple[float, float]] | None = None,
    effort: Mapping[str, Any] | None = None,
    out: list[Path] | None = None,
    figure_style: Path | None = None,
) -> Answer:
    """Prove that cubes of positions are kept, whichever joint locks and wherever.

    A position is kept as for `workspace`, but here neither positions nor locked angles are
    sampled: the volume is a lower bound, rounding errors included. The search goes through the
    arm's reach group by group, on all cores; after Ctrl-C, what has been proved is shown and
    written. Collisions are not checked.

    Parameters
    ----------
    effort
        How much is tried. May be repeated: finest, the edge of the smallest cubes in metres (a
        hundredth of the sum of the links), halvings of cubes that are not proved (3).
    out
        The file that is written: the cubes in .npz, which `verify` reads, or a picture in .svg,
        .png or .pdf. May be repeated.
    """
    from lockedjoint.figures.robots import draw_kept
    from lockedjoint.formulations.io.files import write_bytes
    from lockedjoint.workspaces.of_robot import prove_workspace as proved

    files = Outputs.checked(out, (".npz", *PICTURES), [source_file(robot), figure_style])
    check_style(figure_style, files.picture is not None, "one with a picture as --out")
    given: Any = {"progress": progress, **checked_effort(effort, CubeSearch)}
    found = proved(robot, limits=limits, **given)
    sentence = "Interrupted: what was proved until then is above."
    failure = [] if found.complete else [sentence]
    status = 0 if found.complete else INTERRUPTED
    if found.cubes is None or not found.size:
        more = "Nothing was proved to be kept: try other --limits, or a smaller finest."
        return Answer(found.to_dict(), failure=[*failure, more], status=status or 1)
    path, cubes = files.of(".npz"), found.cubes
    if path is not None:
        write_bytes(path, cubes.to_bytes())
    draw(files.picture, figure_style, lambda: draw_kept(cubes))
    return Answer(found.to_dict(), failure=failure, status=status)


def _text(result: Workspace) -> str:
    """Return the result in lines: the size, and the artificial limits of each joint."""
    unit = "m²" if result.dimension == 2 else "m³"
    values = {k: v for k, v in result.to_dict().items() if k != "limits"}
    for step, ends in zip(result.arm.joints, result.limits, strict=True):
        whole = " (physical)" if ends == (step.lower, step.upper) else ""
        values[f"limits of {step.name} ({step.unit})"] = (
            "{:.4f} to {:.4f}".format(*ends) + whole
        )
    return as_text({"unit": unit, **values})
