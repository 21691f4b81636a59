"""``lockedjoint posture``: the most failure-tolerant posture of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from formulations.commands import arguments as cli
from formulations.commands.arguments import option
from formulations.commands.measure import failures_text, robot_text
from formulations.commands.output import INTERRUPTED, as_table, end, show, warn
from formulations.commands.robot_arguments import ArmOptions, PoseOptions

if TYPE_CHECKING:
    from formulations.robots.pose_constrained_arm import LockedReach
    from formulations.robots.posture import Posture


def posture(
    robot: ArmOptions,
    pose: PoseOptions,
    failures: cli.FailureOptions,
    formulation: str = option(
        "NAME", "residual, max-min, isotropy or manipulability.", "max-min"
    ),
    goal: cli.Goal = "worst",
    clearance: float | None = option(
        "METRES",
        "Distance that the links keep from each other; by default they may touch. Needs "
        "coal, and reads the meshes that the URDF file names.",
        positive=True,
    ),
    starts: int | None = option(
        "K",
        "Random starts; by default 100 to 6400, until it is unlikely that a better posture "
        "was missed.",
        low=1,
        high=cli.MOST_STARTS,
    ),
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    ipopt: cli.Ipopt = None,
    out: cli.JsonFile = None,
    as_json: cli.Json = False,
) -> None:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    A formulation over the joints' positions, from random postures; the answer is recomputed
    from its Jacobian. With --at, the best of those that hold the tool at a pose, and where each
    joint may lock so that the pose can still be reached. With --held, the best posture after a
    failure. `measure-robot --configuration FILE` reads what --out writes. Exit status 1, and no
    file, if no start converged.
    """
    from formulations.io.files import prepare_file
    from formulations.robots.posture import best_posture
    from formulations.robots.posture_search import Search
    from nlp.executors import default_workers

    arm = robot.arm()
    count, options = workers or default_workers(), cli.ipopt_options(ipopt)
    search = Search(
        *(formulation, failures.locked, starts, seed, count, options, True),
        failures=failures.scenarios(arm.chain.names),
        probabilities_known=failures.probabilities_known,
        goal=goal,
    )
    wanted = pose.pose()
    apart = None
    if clearance is not None:
        from formulations.clearance.link_clearance import read_clearance

        apart = read_clearance(robot.file, arm.chain, clearance)
    prepare_file(out, inputs=[robot.file])
    best = best_posture(arm, search, at=wanted, clearance=apart)
    warn(*(f"Note: {note}" for note in best.assessment.notes))
    if best.complete and not best.settled:
        warn("Note: a better posture may have been missed; try more --starts.")
    how = {
        "formulation": formulation,
        **({} if search.failures is None else {"goal": goal}),
        "starts": f"{best.starts} (seed {seed}), best reached by {best.reached_best}",
        "optima": f"{best.optima} seen, {100 * best.unseen_share:.2g} % of all expected unseen",
        "status counts": best.status_counts,
        "midway sigma": best.mid_range_sigma,
        **_pose_and_clearance(best),
    }
    if not best.starts:
        how = {"formulation": formulation, "starts": "none: every posture is as bad"}
    parts = [robot_text(best.assessment, how, _source(best))]
    parts += [] if best.failures is None else [failures_text(best.failures)]
    parts += [] if best.at is None else [_after_failure(best.at.after_failure)]
    converged = best.reached_best or not best.starts
    show(best.to_dict(), as_json, lambda _: "\n\n".join(parts), out if converged else None)
    if not best.complete:
        asked = "" if starts is None else f" of {starts}"
        end(f"Interrupted: {best.starts}{asked} starts ended.", INTERRUPTED)
    if not converged:
        end("Not solved: no start converged, and nothing is written.")


def _pose_and_clearance(posture: Posture) -> dict[str, str]:
    lines = {}
    if posture.at is not None:
        pose, off = posture.at.pose, f"{posture.at.position_error:.1g} m"
        if pose.quaternion is not None:
            off += f" and {posture.at.orientation_error:.1g} rad"
        lines["at"] = f"{', '.join(f'{x:g}' for x in pose.position)} m, off by {off}"
    if posture.clearance is not None:
        for name, pair in (
            ("closest links", posture.clearance.closest),
            ("closest left out", posture.clearance.closest_left_out),
        ):
            if pair is not None:
                lines[name] = f"{pair.distance:.4g} m: {' and '.join(pair.links)}"
    return lines


def _after_failure(failures: Sequence[LockedReach]) -> str:
    lines = []
    for failure in failures:
        ranges = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in failure.ranges)
        line = {"locked": failure.joint, "% of range": failure.percent}
        lines.append(line | {"pose within reach where it locks at": ranges or "only here"})
    return as_table(lines)


def _source(posture: Posture) -> str:
    if not posture.starts:
        return "midway between the limits"
    return "the best found" if posture.reached_best else "the best seen; no start converged"
