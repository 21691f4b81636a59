"""``lockedjoint posture``: where a robot is most failure tolerant."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.options import LATER, Only
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text
from lockedjoint.commands.robot_text import robot_text
from lockedjoint.commands.shared import Failures, WholeRobot, source_file
from lockedjoint.nlp.errors import InputError
from lockedjoint.robots.search import Search

if TYPE_CHECKING:
    from lockedjoint.kinematics.pose import Pose
    from lockedjoint.robots.pose_constrained_arm import LockedReach
    from lockedjoint.robots.posture import Posture

_FIELDS = ("formulation", "maximise", "starts", "seed", "ipopt")


def posture(
    robot: WholeRobot,
    failing: Failures,
    search: Annotated[Search, Only(_FIELDS), LATER],
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
        all that is measured, as JSON.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.nlp.executors import default_workers
    from lockedjoint.robots.posture import posture as best_of

    prepare_file(out, inputs=[source_file(robot)])
    pose = near(at, tolerance)
    given: dict[str, Any] = {"progress": True, **search}  # type: ignore[dict-item]
    given["workers"] = workers or default_workers()
    model = failing.model(robot.arm.chain.names)
    given["failures"] = failing.failures if model is None else model
    given["probabilities_known"] = failing.probabilities_known
    chosen = Search(**given)
    best = best_of(robot, chosen, at=pose)
    notes = [*best.assessment.notes, *(() if pose is None else pose.notes)]
    alike = all(robot.chain.prismatic)  # J is the same everywhere
    if best.complete and not best.settled and not alike:
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
    how: dict[str, object] = {"formulation": search.formulation}
    if best.starts:
        how |= {} if search.model is None else {"maximise": search.maximise}
        unseen = f"{100 * best.unseen_share:.{0 if best.unseen_share > 0.1 else 1}f}"
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
    parts = [robot_text(best.assessment, how, source, columns)]
    parts += [] if best.unequal is None else [as_text(best.unequal)]
    parts += [] if best.at is None else [_after_failure(best.at.after_failure)]
    return "\n\n".join(parts)


def _pose_and_clearance(posture: Posture) -> dict[str, str]:
    lines = {}
    if posture.at is not None:
        pose, off = posture.at.pose, f"{posture.at.position_error:.1g} m"
        if pose.quaternion is not None:
            off += f" and {posture.at.orientation_error:.1g} rad"
        lines["at"] = f"{', '.join(f'{x:g}' for x in pose.position)} m, off by {off}"
    if posture.clearance is not None:
        found = posture.clearance.closest, posture.clearance.closest_left_out
        for name, pair in zip(("closest links", "closest left out"), found, strict=True):
            if pair is not None:
                lines[name] = f"{pair.distance:.4g} m: {' and '.join(pair.links)}"
        if posture.clearance.unchecked:
            lines["links not looked at"] = ", ".join(posture.clearance.unchecked)
        nearer = [f"{names} {least:.4g} m" for names, least in posture.clearance.nearer.items()]
        if nearer:
            lines["never so far apart"] = f"asked to keep {', '.join(nearer)}"
    return lines


def _after_failure(failures: Sequence[LockedReach]) -> str:
    lines = []
    for failure in failures:
        ranges = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in failure.ranges)
        line = {"locked": failure.joint, "% of range": failure.percent}
        within = "pose within reach where it locks at (rad or m)"
        lines.append(line | {within: ranges or "only here"})
    return as_table(lines)
