"""``lockedjoint workspace``: what failures leave of the workspace, and the best limits."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands import robot_arguments as robot
from formulations.commands.arguments import (
    Json,
    NoTitle,
    Seed,
    Size,
    Style,
    look,
    positive_option,
    refuse_unused,
    whole_option,
)
from formulations.commands.arguments import progress as show_progress
from formulations.commands.output import as_text, show
from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.kinematics.serial_arm import Ranges, SerialArm
    from formulations.workspaces.workspace import Workspace
    from nlp.arrays import FloatArray

_CHOICES = ("limits", "lengths")
# Voxels that the sum of the links is long, with an orientation that is held in space.
_IN_SPACE = 12


def workspace(
    context: typer.Context,
    file: robot.File,
    tip: robot.Tip = None,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=LOW:HIGH",
            help="Artificial limits of a joint, radians or metres. May be repeated.",
            show_default="the physical limits",
        ),
    ] = None,
    orientation: Annotated[
        str | None,
        typer.Option(
            metavar="ROLL,PITCH,YAW",
            help="Hold the tip's link at this orientation: radians, fixed axes of the base; or "
            "QX,QY,QZ,QW. For planar arms of four joints and others of seven.",
            show_default="free",
        ),
    ] = None,
    optimise: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="limits: choose the artificial limits that keep the most; lengths: link "
            "lengths of equal sum, too.",
            show_default=False,
        ),
    ] = None,
    voxel: Annotated[
        float | None,
        positive_option(
            "METRES",
            "Edge of the grid's cells.",
            show_default="a fiftieth of the sum of the links; a twelfth with --orientation, in "
            "space",
        ),
    ] = None,
    step: Annotated[
        float,
        positive_option(
            "DEGREES", "Distance of the angles at which a joint may lock.", "--slice"
        ),
    ] = 5.0,
    least_width: Annotated[
        float,
        positive_option("DEGREES", "Least width of limits that are chosen."),
    ] = 10.0,
    starts: Annotated[int, whole_option(1, "K", "Starts of the search on a grid.", 10**6)] = 4,
    base: robot.Base = None,
    point: robot.Point = None,
    held: robot.Held = None,
    seed: Seed = 0,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the workspace: SVG, PNG or PDF."),
    ] = None,
    size: Size = None,
    no_title: NoTitle = False,
    style: Style = None,
    out: robot.JsonFile = None,
    as_json: Json = False,
) -> None:
    """Measure the workspace that is kept whatever joint fails, or make it largest.

    A position is kept if the arm reaches it within the artificial limits, and with any joint
    locked anywhere within its artificial limits and the others within their physical limits.
    The orientation of the tool is free without --orientation. The first command to try is with
    --optimise limits: within the physical limits alone, many arms keep nothing.
    """
    from formulations.kinematics.serial_arm import SerialArm
    from formulations.plot.style import content, kind_of, looking
    from formulations.workspaces.best_limits import best_limits
    from formulations.workspaces.pose_sets import PoseSets
    from formulations.workspaces.workspace import check_limits, measured
    from formulations.workspaces.workspace import workspace as found_workspace
    from nlp.files import prepare_file, write_bytes

    if figure is None:
        refuse_unused(context, ("size", "no_title", "style"), "no --figure")
    if optimise is None:
        refuse_unused(context, ("least_width", "starts", "seed"), "no --optimise")
    elif optimise not in _CHOICES:
        raise InputError("--optimise", optimise, "limits or lengths")
    elif limits:
        raise InputError("--limits", " ".join(limits), "none with --optimise")
    elif optimise == "lengths" and orientation is not None:
        raise InputError("--optimise", optimise, "limits with --orientation")
    turn = None if orientation is None else _turn(orientation)
    arm = SerialArm.from_chain(robot.chain(file, tip, base, point, held))
    chosen = _limits(limits or [], arm)
    check_limits(arm, chosen)
    picture = kind_of(prepare_file(figure, "--figure", [file, style])) if figure else ""
    looks = look(size, no_title, style)
    if out is not None:
        prepare_file(out, inputs=[file])
    coarse = turn is not None and not arm.is_planar
    edge = voxel or float(sum(arm.links)) / (_IN_SPACE if coarse else 50)
    sets = None
    if turn is not None:
        sets = PoseSets(arm, turn, edge, radians(step), show_progress)
    if optimise is not None:
        width, both = radians(least_width), optimise == "lengths"
        arm, chosen = best_limits(
            arm,
            edge,
            lengths=both,
            least_width=width,
            starts=starts,
            seed=seed,
            progress=show_progress,
            sets=sets,
        )
    if sets is None:
        found = found_workspace(arm, chosen, edge, radians(step), show_progress)
    else:
        found = measured(sets, chosen, show_progress)
    show_progress("")
    if figure is not None:
        from formulations.plot.workspace import draw

        with looking(looks):
            drawn = content(draw(found), picture)
        write_bytes(figure, drawn)
    show(found.to_dict(), as_json, lambda _: _text(found), out)


def _turn(text: str) -> FloatArray:
    import numpy as np
    from scipy.spatial.transform import Rotation

    numbers = [robot.number("--orientation", one) for one in text.split(",")]
    if len(numbers) == 3 and max(map(abs, numbers)) <= 100:
        return np.asarray(Rotation.from_euler("xyz", numbers).as_matrix())
    if len(numbers) == 4 and abs(np.linalg.norm(numbers) - 1) < 1e-6:
        return np.asarray(Rotation.from_quat(numbers).as_matrix())
    allowed = "ROLL,PITCH,YAW in radians, or QX,QY,QZ,QW of length 1"
    raise InputError("--orientation", text, allowed)


def _limits(settings: list[str], arm: SerialArm) -> Ranges:
    from formulations.kinematics.chain import listed, nearest

    names = [one.name for one in arm.steps]
    found = dict(zip(names, arm.physical, strict=True))
    given = set()
    for setting in settings:
        name, equals, both = (part.strip() for part in setting.partition("="))
        low, colon, high = both.partition(":")
        if not (name and equals and colon):
            raise InputError("--limits", setting, "JOINT=LOW:HIGH, radians or metres")
        if name not in found:
            allowed = f"one of {listed(names)}{nearest(name, names)}"
            raise InputError("--limits of joint", name, allowed)
        if name in given:
            raise InputError("--limits", f"{name} twice", "every joint once")
        given.add(name)
        ends = [robot.number(f"--limits of {name}", one) for one in (low, high)]
        found[name] = (ends[0], ends[1])
    return tuple(found.values())


def _text(found: Workspace) -> str:
    unit = "m²" if found.dimension == 2 else "m³"
    values = found.to_dict()
    kept: dict[str, object] = {
        f"{values['quantity']} kept": f"{found.size:.6g} {unit}, error {found.error:.2g}",
        "without failure": f"{found.before:.6g} {unit}",
        "within physical limits": f"{found.physical:.6g} {unit}",
        "method": str(values["method"]),
    }
    if found.sets.sampled:
        kept["voxel"] = f"{found.sets.voxel:.4g} m, one random point in each"
    else:
        kept["voxel"] = (
            f"{found.sets.voxel:.4g} m, of which all but a closed form over-estimates"
        )
    if found.passed:
        # NaN where no voxel is that deep.
        shares = ", ".join("–" if one != one else f"{100 * one:.0f} %" for one in found.passed)
        kept["passed by depth"] = f"{shares} of voxels 0, 1, … layers below the surface"
        kept["raw voxels"] = f"{found.raw:.6g} {unit}"
    if found.critical:
        kept["critical"] = (
            f"{', '.join(found.critical)}: nothing is kept, because of where it may lock"
        )
    lines = [as_text(kept), "", "joint: artificial limits"]
    for step, (low, high) in zip(found.arm.steps, found.limits, strict=True):
        whole = " (physical)" if (low, high) == (step.lower, step.upper) else ""
        lines.append(f"  {step.name}: {low:.4f} to {high:.4f}{whole}")
    lines.append("links: " + "  ".join(f"{one:.4f}" for one in found.arm.links))
    return "\n".join(lines)
