"""``lockedjoint posture``: the most failure-tolerant posture of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands import robot_arguments as robot
from formulations.commands.arguments import (
    Goal,
    Ipopt,
    Json,
    Locked,
    ProbabilitySets,
    Seed,
    Starts,
    Workers,
    failure_scenarios,
    ipopt_options,
)
from formulations.commands.measure_robot import failures_text, robot_text
from formulations.commands.output import INTERRUPTED, show

if TYPE_CHECKING:
    from formulations.robots.pose_constrained_arm import LockedReach
    from formulations.robots.posture import Posture


def posture(
    file: robot.File,
    tip: robot.Tip = None,
    formulation: Annotated[
        str, typer.Option(metavar="NAME", help="residual, max-min, isotropy or manipulability.")
    ] = "max-min",
    at: robot.At = None,
    tolerance: robot.PoseTolerance = None,
    clearance: robot.KeptDistance = None,
    length: robot.Length = None,
    task: robot.TaskDirections = "all",
    frame: robot.Frame = "base",
    held: robot.Held = None,
    locked: Locked = 1,
    failure_probabilities: ProbabilitySets = None,
    never_fails: robot.NeverFails = None,
    goal: Goal = "worst",
    base: robot.Base = None,
    point: robot.Point = None,
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    ipopt: Ipopt = None,
    out: robot.JsonFile = None,
    as_json: Json = False,
) -> None:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    A formulation over the joints' positions, from random postures; the answer is measured
    again from its Jacobian alone. With --at, the best of those that hold the tool at a pose,
    and where each joint may lock so that the pose can still be reached. With --held, the best
    posture after a failure. `measure-robot --configuration FILE` reads what --out writes.
    """
    from formulations.robots.posture import best_posture
    from formulations.robots.posture_search import Search
    from formulations.unequal_max_min import checked_goal
    from nlp.executors import default_workers
    from nlp.files import prepare_file

    arm = robot.arm(file, tip, base, point, task, frame, length, held)
    count, options = workers or default_workers(), ipopt_options(ipopt)
    models = failure_scenarios(failure_probabilities, never_fails, arm.chain.names, locked)
    search = Search(
        *(formulation, locked, starts, seed, count, options, True),
        failures=models,
        probabilities_known=failure_probabilities is not None,
        goal=checked_goal(goal),
    )
    wanted = robot.pose(at, tolerance)
    kept = robot.kept_distance(file, arm.chain, clearance)
    if out is not None:
        prepare_file(out, inputs=[file])
    found = best_posture(arm, search, at=wanted, clearance=kept)
    robot.print_notes(found.assessment)
    how = {
        "formulation": formulation,
        **({} if models is None else {"goal": goal}),
        "starts": f"{found.starts} (seed {seed}), best reached by {found.reached_best}",
        "status counts": found.status_counts,
        "midway sigma": found.mid_range_sigma,
        **_held(found),
    }
    if not found.starts:
        how = {"formulation": formulation, "starts": "none: every posture is as bad"}
    parts = [robot_text(found.assessment, how, _source(found))]
    parts += [] if found.failures is None else [failures_text(found.failures)]
    parts += [] if found.at is None else [_after_failure(found.at.after_failure)]
    text = "\n\n".join(parts)
    show(found.to_dict(), as_json, lambda _: text, out)
    if not found.complete:
        typer.echo(f"Interrupted: {found.starts} of {starts} starts ended.", err=True)
        raise typer.Exit(INTERRUPTED)


def _held(found: Posture) -> dict[str, str]:
    """Return what the pose and the clearance came to, in words."""
    lines = {}
    if found.at is not None:
        pose, off = found.at.pose, f"{found.at.position_error:.1g} m"
        if pose.quaternion is not None:
            off += f" and {found.at.orientation_error:.1g} rad"
        lines["at"] = f"{', '.join(f'{x:g}' for x in pose.position)} m, off by {off}"
    if found.clearance is not None:
        one = found.clearance
        pair = " and ".join(one.closest.links)
        lines["closest links"] = f"{one.closest.distance:.4g} m: {pair} ({one.pairs} pairs)"
        if one.closest_left_out is not None:
            pair, near = " and ".join(one.closest_left_out.links), one.closest_left_out.distance
            lines["left out"] = f"{near:.4g} m: {pair}, the closest of {len(one.left_out)}"
    return lines


def _after_failure(found: Sequence[LockedReach]) -> str:
    from tabulate import tabulate

    lines = [
        (
            one.joint,
            f"{one.percent:.1f}",
            ", ".join(f"{low:.2f} to {high:.2f}" for low, high in one.ranges) or "only here",
        )
        for one in found
    ]
    heads = ("locked", "% of range", "pose within reach where it locks at")
    return str(tabulate(lines, heads, tablefmt="plain", disable_numparse=True))


def _source(found: Posture) -> str:
    if not found.starts:
        return "midway between the limits"
    return "the best found" if found.reached_best else "the best seen; no start converged"
