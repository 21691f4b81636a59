"""``lockedjoint posture``: where a robot is most failure tolerant.

What comes in: a robot, which joints may fail, how to search, and perhaps a pose of the tool.
What goes out: an `Answer` with text, JSON and exit status, and with --out the JSON as a file.
The search is in `lockedjoint.robots.posture`; this file reads, calls and puts into words.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.options import FieldsOf
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text
from lockedjoint.commands.robot_text import chosen_of_robot, robot_text
from lockedjoint.commands.shared import NOT_CHECKED, Failures, WholeRobot, source_file
from lockedjoint.nlp.errors import InputError
from lockedjoint.robots.search import Search

if TYPE_CHECKING:
    from lockedjoint.kinematics.pose import Pose
    from lockedjoint.robots.pose_constrained_arm import LockedReach
    from lockedjoint.robots.posture import Posture

# Fields of `Search` that are options; the command itself sets the others.
_SEARCH_OPTIONS = ("formulation", "maximise", "starts", "seed", "ipopt")
# Share of unseen optima above which it is shown in whole percents; a smaller one has a decimal.
_LARGE_UNSEEN_SHARE = 0.1


def posture(
    robot: WholeRobot,
    failing: Failures,
    search: Annotated[dict[str, Any], FieldsOf(Search, _SEARCH_OPTIONS)],
    at: Pose | None = None,
    tolerance: list[float] | None = None,
    workers: int | None = None,
    columns: list[str] | None = None,
    out: Path | None = None,
) -> Answer:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    Solves a formulation for the joints' positions, from random postures; the answer is
    recomputed from its Jacobian. With --at, the best of those that hold the tool at a pose, and
    where each joint may lock so that the pose can still be reached. With --locked, the best
    posture after a failure. `measure ROBOT --q FILE` reads what --out writes. Exit status 1,
    and no file, if no start converged.

    Parameters
    ----------
    at
        By default anywhere.
    out
        The file that is written: all that is measured, as JSON.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.nlp.executors import default_workers
    from lockedjoint.robots.posture import posture as best_of

    columns = chosen_of_robot(columns, robot.arm.task.directions)
    prepare_file(out, inputs=[source_file(robot)])
    pose = near(at, tolerance)
    failure_model = failing.model(robot.arm.chain.names)
    chosen = Search(
        progress=True,
        workers=workers or default_workers(),
        failures=failing.failures if failure_model is None else failure_model,
        probabilities_known=failing.probabilities_known,
        **search,
    )
    best = best_of(robot, chosen, at=pose)
    notes = [*best.assessment.notes, *(() if pose is None else pose.notes)]
    # An arm with prismatic joints only has the same Jacobian at every posture.
    constant_jacobian = all(robot.chain.prismatic)
    if best.complete and not best.settled and not constant_jacobian:
        notes.append("a better posture may have been missed; try more --starts.")
    converged = best.reached_best or not best.starts
    text = _text(best, chosen, columns)
    values = {**best.to_dict(), "angles": "rad"}
    answer = partial(Answer, values, text, out if converged else None, notes)
    if not best.complete:
        asked = "" if chosen.starts is None else f" of {chosen.starts}"
        sentence = f"Interrupted: {best.starts}{asked} starts ended."
        return answer(failure=[sentence], status=INTERRUPTED)
    if not converged:
        sentence = "Not solved: no start converged, and nothing is written."
        return answer(failure=[sentence])
    return answer()


def near(at: Pose | None, tolerance: list[float] | None) -> Pose | None:
    """Return a pose with its tolerances; InputError if there are some and no pose."""
    if at is None:
        if tolerance is not None:
            shown = ",".join(f"{value:g}" for value in tolerance)
            raise InputError("--tolerance", shown, "none without --at")
        return None
    return at if tolerance is None else at.within(tolerance)


def _text(best: Posture, search: Search, columns: list[str] | None) -> str:
    """Return what a user reads: how the posture was found, the assessment, the failures."""
    how: dict[str, object] = {"formulation": search.formulation}
    if best.starts:
        if search.model is not None:
            how["maximise"] = search.maximise
        decimals = 0 if best.unseen_share > _LARGE_UNSEEN_SHARE else 1
        unseen = f"{100 * best.unseen_share:.{decimals}f}"
        how |= {
            "starts": f"{best.starts} (seed {search.seed}), best reached by"
            f" {best.reached_best}",
            "optima": f"{best.optima} seen, {unseen} % of all expected unseen",
            "status counts": best.status_counts,
            "midway sigma": best.mid_range_sigma,
            **_pose_and_clearance(best),
        }
        source = "the best found" if best.reached_best else "the best seen; no start converged"
    else:
        how["starts"] = "none: every posture is as bad"
        source = "midway between the limits"
    if best.clearance is None:
        how["collisions"] = NOT_CHECKED
    parts = [robot_text(best.assessment, how, source, columns)]
    if best.unequal is not None:
        parts.append(as_text(best.unequal))
    if best.at is not None:
        parts.append(_after_failure(best.at.after_failure))
    return "\n\n".join(parts)


def _pose_and_clearance(posture: Posture) -> dict[str, str]:
    """Return how nearly the pose is reached and how near the links are, where it was asked."""
    lines = {}
    if posture.at is not None:
        pose = posture.at.pose
        position = ", ".join(f"{coordinate:g}" for coordinate in pose.position)
        error = f"{posture.at.position_error:.1g} m"
        if pose.quaternion is not None:
            error += f" and {posture.at.orientation_error:.1g} rad"
        lines["at"] = f"{position} m, off by {error}"
    clearance = posture.clearance
    if clearance is not None:
        pairs = {
            "closest links": clearance.closest,
            "closest left out": clearance.closest_left_out,
        }
        for name, pair in pairs.items():
            if pair is not None:
                lines[name] = f"{pair.distance:.4g} m: {' and '.join(pair.links)}"
        if clearance.unchecked:
            lines["links not looked at"] = ", ".join(clearance.unchecked)
        nearer = [f"{links} {least:.4g} m" for links, least in clearance.nearer.items()]
        if nearer:
            lines["never so far apart"] = f"asked to keep {', '.join(nearer)}"
    return lines


def _after_failure(failures: Sequence[LockedReach]) -> str:
    """Return a table: at which positions each joint may lock with the pose still in reach."""
    rows = []
    for failure in failures:
        ranges = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in failure.ranges)
        rows.append(
            {
                "locked": failure.joint,
                "% of range": failure.percent,
                "pose within reach where it locks at (rad or m)": ranges or "only here",
            }
        )
    return as_table(rows)
