"""``lockedjoint workspace`` and ``prove-workspace``: what failures leave of the workspace."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lockedjoint.commands.arguments import FigureOptions, Seed, Workers, flag, option
from lockedjoint.commands.output import Answer, as_text, progress
from lockedjoint.commands.robot_arguments import (
    ChainOptions,
    ClearanceOptions,
    LimitOptions,
    chosen_limits,
    numbers,
)
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.nlp.arrays import FloatArray
    from lockedjoint.workspaces.workspace import Workspace

# Voxels that the sum of the links is long, with an orientation that is held in space.
_IN_SPACE = 12


def workspace(
    robot: ChainOptions,
    limits: LimitOptions,
    *,
    orientation: str | None = option(
        "ROLL,PITCH,YAW",
        "Hold the tip's link at this orientation: radians, fixed axes of the base; or "
        "QX,QY,QZ,QW. For planar arms of four joints or more and others of seven or more; by "
        "default free.",
    ),
    optimise: Literal["limits", "lengths"] | None = option(
        None,
        "limits: choose the artificial limits that keep the most; lengths: also the link"
        " lengths, with the same sum.",
    ),
    voxel: float | None = option(
        "METRES",
        "Edge of the grid's cells; by default a fiftieth of the sum of the links (of the "
        "travel where there are none), or a twelfth with --orientation in space or joints to "
        "spare.",
        positive=True,
    ),
    step: float = option(
        "DEGREES",
        "Step between the angles at which a joint may lock.",
        5.0,
        "--slice",
        positive=True,
    ),
    least_width: float = option(
        "DEGREES", "Least width of limits that are chosen.", 10.0, positive=True
    ),
    starts: int = option("K", "Starts of the search for limits.", 4, low=1, high=10**6),
    seed: Seed = 0,
    figure: Path | None = option("FILE", "Draw the workspace: SVG, PNG or PDF."),
    out: Path | None = option("FILE", "Write the result there, as JSON."),
    out_points: Path | None = option(
        "FILE", "Write the kept voxels there, and a point of each: NPZ."
    ),
    mesh: Path | None = option(
        "FILE",
        "Write the surface of the kept voxels there: PLY, for `view --mesh` and Blender.",
    ),
    figure_options: FigureOptions,
    apart: ClearanceOptions,
) -> Answer:
    """Measure the workspace that is kept whatever joint fails, or make it largest.

    A position is kept if the arm reaches it within the artificial limits, and with any joint
    locked anywhere within its artificial limits and the others within their physical limits.
    The orientation of the tool is free without --orientation. The first command to try is with
    --optimise limits: within the physical limits alone, many arms keep nothing. With
    --clearance or --obstacles configurations in which links are too near do not count. With a
    free orientation only the size and its error heed this; the voxels do not.
    """
    from lockedjoint.figures.style import content, kind_of, looking
    from lockedjoint.formulations.io.files import prepare_file, write_bytes
    from lockedjoint.kinematics.serial_arm import SerialArm
    from lockedjoint.workspaces.best_limits import best_limits
    from lockedjoint.workspaces.pose_sets import PoseSets
    from lockedjoint.workspaces.workspace import check_limits, measured
    from lockedjoint.workspaces.workspace import workspace as workspace_of

    if limits.limits and optimise is not None:
        raise InputError("--limits", " ".join(limits.limits), "none with --optimise")
    if optimise == "lengths" and orientation is not None:
        raise InputError("--optimise", optimise, "limits with --orientation")
    rotation = None if orientation is None else _rotation(orientation)
    chain = robot.chain()
    arm = SerialArm.from_chain(chain)
    clearance = apart.read(robot.file, chain)
    if clearance is not None and optimise == "lengths":
        raise InputError("--optimise", optimise, "limits with --clearance or --obstacles")
    chosen = chosen_limits(limits, arm)
    check_limits(arm, chosen)
    form = kind_of(figure) if figure else ""
    prepare_file(figure, "--figure", [robot.file, figure_options.style, apart.obstacles])
    look = figure_options.look()
    inputs = [robot.file, figure, apart.obstacles]
    prepare_file(out, inputs=inputs)
    _prepare(out_points, "--out-points", ".npz", [*inputs, out])
    _prepare(mesh, "--mesh", ".ply", [*inputs, out])
    coarse = rotation is not None and (not arm.is_planar or len(arm.steps) > 4)
    travel = sum(step.upper - step.lower for step in arm.steps if step.prismatic)
    edge = voxel or float(sum(arm.links) or travel) / (_IN_SPACE if coarse else 50)
    sets = None
    if rotation is not None:
        sets = PoseSets(arm, rotation, edge, radians(step), progress, clearance=clearance)
    if optimise is not None:
        arm, chosen = best_limits(
            arm,
            edge,
            lengths=optimise == "lengths",
            least_width=radians(least_width),
            starts=starts,
            seed=seed,
            progress=progress,
            sets=sets,
        )
    if sets is None:
        result = workspace_of(arm, chosen, edge, radians(step), progress, clearance)
    else:
        result = measured(sets, chosen, progress)
    if figure is not None:
        from lockedjoint.figures.robots import draw_workspace

        with looking(look):
            write_bytes(figure, content(draw_workspace(result), form))
    files = {out_points: result.points_file, mesh: result.mesh_file}
    wanted = [path for path in files if path is not None]
    if wanted and not result.size:
        names = " and ".join(map(str, wanted))
        failure = [f"Nothing is kept, so that {names} was not written."]
        return Answer(result.to_dict(), _text(result), out, failure=failure, status=1)
    for path in wanted:
        write_bytes(path, files[path]())
    return Answer(result.to_dict(), _text(result), out)


def prove_workspace(
    robot: ChainOptions,
    limits: LimitOptions,
    *,
    finest: float | None = option(
        "METRES",
        "Edge of the smallest cubes; by default a hundredth of the sum of the links.",
        positive=True,
    ),
    halvings: int = option(
        "K", "How often cubes that are not proved are halved.", 3, low=0, high=12
    ),
    above: bool = flag(
        "--above",
        "Also prove of cubes that they are lost: a bound from above. For planar arms; of "
        "others it is weak.",
    ),
    out: Path | None = option("FILE", "Write the cubes there: NPZ, which `verify` reads."),
    figure: Path | None = option("FILE", "Draw the cubes: SVG, PNG or PDF."),
    figure_options: FigureOptions,
    workers: Workers = None,
    seed: Seed = 0,
) -> Answer:
    """Prove that cubes of positions are kept, whichever joint locks and wherever.

    A position is kept as for `workspace`, but here neither positions nor locked angles are
    sampled: the volume is a lower bound, rounding errors included. The search goes through the
    arm's reach group by group; after Ctrl-C, what has been proved is shown and written.
    Collisions are not checked.
    """
    from lockedjoint.figures.robots import draw_kept
    from lockedjoint.figures.style import content, kind_of, looking
    from lockedjoint.formulations.io.files import prepare_file, write_bytes
    from lockedjoint.kinematics.serial_arm import SerialArm
    from lockedjoint.nlp.executors import LocalExecutor, default_workers
    from lockedjoint.workspaces.guaranteed import guaranteed_workspace
    from lockedjoint.workspaces.kept_cubes import KeptCubes, LostCubes
    from lockedjoint.workspaces.lost_cubes import cubes_around, lost_cubes

    _prepare(out, "--out", ".npz", [robot.file, figure])
    form = kind_of(figure) if figure else ""
    look = figure_options.look()
    prepare_file(figure, "--figure", [robot.file, figure_options.style])
    arm = SerialArm.from_chain(robot.chain())
    ranges = chosen_limits(limits, arm)
    edge = finest or float(sum(arm.links)) / 100
    if above:  # what is refused is better known before an hour's work
        cubes_around(arm, ranges, edge / 2, halvings)
    parts: list[KeptCubes] = []
    lost: list[LostCubes] = []
    status = 0
    with LocalExecutor(workers or default_workers()) as executor:
        found = guaranteed_workspace(
            *(arm, ranges, edge / 2, halvings), seed=seed, executor=executor, progress=progress
        )
        try:
            parts.extend(found)
            if above:
                given = (KeptCubes.joined(parts), edge / 2, halvings)
                lost.extend(lost_cubes(*given, executor=executor, progress=progress))
        except KeyboardInterrupt:
            status = 130
    cubes = KeptCubes.joined(parts) if parts else None
    if cubes and lost:
        cubes = replace(cubes, lost=LostCubes.joined(lost))
    size = cubes.size if cubes else 0.0
    values = {
        "kept_for_certain": size,
        **({"at_most": cubes.at_most} if cubes and cubes.lost else {}),
        "unit": "m²" if arm.is_planar else "m³",
        "cubes": len(cubes.width) if cubes else 0,
        "edges": sorted({2 * width for width in cubes.width.tolist()}) if cubes else [],
        "kind": "proved, rounding errors included",
        "complete": status == 0,
        "limits": {step.name: list(ends) for step, ends in zip(arm.steps, ranges, strict=True)},
    }
    failure = ["Interrupted: what was proved until then is above."] if status else []
    if not size:
        failure.append(
            "Nothing was proved to be kept: try other --limits, or a smaller --finest."
        )
        return Answer(values, failure=failure, status=status or 1)
    if out is not None and cubes is not None:
        write_bytes(out, cubes.to_bytes())
    if figure is not None and cubes is not None:
        with looking(look):
            write_bytes(figure, content(draw_kept(cubes), form))
    return Answer(values, failure=failure, status=status)


def _prepare(
    path: Path | None, option_name: str, ending: str, inputs: list[Path | None]
) -> None:
    """Raise InputError unless a file has its ending and can be written."""
    from lockedjoint.formulations.io.files import prepare_file

    if path is not None and path.suffix != ending:
        raise InputError(option_name, path, f"a file that ends in {ending}")
    prepare_file(path, option_name, inputs)


def _rotation(text: str) -> FloatArray:
    import numpy as np
    from scipy.spatial.transform import Rotation

    values = numbers("--orientation", text)
    if len(values) == 3 and max(map(abs, values)) <= 100:
        return np.asarray(Rotation.from_euler("xyz", values).as_matrix())
    if len(values) == 4 and abs(np.linalg.norm(values) - 1) < 1e-6:
        return np.asarray(Rotation.from_quat(values).as_matrix())
    allowed = "ROLL,PITCH,YAW in radians, or QX,QY,QZ,QW of length 1"
    raise InputError("--orientation", text, allowed)


def _text(result: Workspace) -> str:
    unit = "m²" if result.dimension == 2 else "m³"
    values = {k: v for k, v in result.to_dict().items() if k != "limits"}
    for step, ends in zip(result.arm.steps, result.limits, strict=True):
        whole = " (physical)" if ends == (step.lower, step.upper) else ""
        values[f"limits of {step.name}"] = "{:.4f} to {:.4f}".format(*ends) + whole
    return as_text({"unit": unit, **values})
