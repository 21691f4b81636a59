"""``lockedjoint measure-robot``, ``posture`` and ``codegen``: a robot's failure tolerance."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import option
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text
from lockedjoint.commands.robot_arguments import (
    ArmOptions,
    ClearanceOptions,
    Configuration,
    PoseOptions,
    read_configuration,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from lockedjoint.robots.pose_constrained_arm import LockedReach
    from lockedjoint.robots.posture import Posture
    from lockedjoint.robots.robot_assessment import AtLength, Failure, RobotAssessment

# A singular value up to this is rounding.
_ROUNDING = 1e-12
# Failures shown, the worst first; the rest is in the JSON.
_SHOWN = 12


def measure_robot(
    robot: ArmOptions,
    failures: cli.FailureOptions,
    configuration: Configuration = None,
    out: cli.JsonFile = None,
) -> Answer:
    """Measure how failure tolerant a robot is at a configuration.

    Which joint's failure is the worst and in which direction, how far from the bound that is,
    and how the answer depends on the characteristic length in which metres are measured.
    By default joints without limits are at 0.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.robots import robot_assessment

    arm = robot.arm()
    model = failures.model(arm.chain.names)
    prepare_file(out, inputs=[robot.file, Path(configuration or robot.file)])
    position = read_configuration(configuration, arm.chain)
    assessment = robot_assessment.measure_robot(arm, position, failures.locked)
    source = "midway between the limits" if configuration is None else "as given"
    plain = {"model": assessment.robot, **asdict(assessment)}
    text = _robot_text(assessment, {}, source)
    if model is not None:
        known = failures.probabilities_known
        unequal = robot_assessment.measure_robot_unequal(arm, assessment.jacobian, model, known)
        plain |= unequal
        text += f"\n\n{as_text(unequal)}"
    return Answer(plain, text, out, assessment.notes)


def posture(
    robot: ArmOptions,
    pose: PoseOptions,
    failures: cli.FailureOptions,
    apart: ClearanceOptions,
    formulation: str = option(
        "NAME", "residual, max-min, isotropy, manipulability or condition.", "max-min"
    ),
    goal: cli.Goal = "worst",
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
) -> Answer:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    Solves a formulation for the joints' positions, from random postures; the answer is
    recomputed from its Jacobian. With --at, the best of those that hold the tool at a pose, and
    where each joint may lock so that the pose can still be reached. With --held, the best
    posture after a failure. `measure-robot --configuration FILE` reads what --out writes. Exit
    status 1, and no file, if no start converged.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.nlp.executors import default_workers
    from lockedjoint.robots.posture import best_posture
    from lockedjoint.robots.posture_search import Search

    arm = robot.arm()
    count, options = workers or default_workers(), cli.ipopt_options(ipopt)
    search = Search(
        *(formulation, failures.locked, starts, seed, count, options, True),
        failures=failures.model(arm.chain.names),
        probabilities_known=failures.probabilities_known,
        goal=goal,
    )
    wanted = pose.pose()
    clearance = apart.read(robot.file, arm.chain)
    prepare_file(out, inputs=[robot.file, apart.obstacles])
    best = best_posture(arm, search, at=wanted, clearance=clearance)
    notes = [*best.assessment.notes]
    alike = all(arm.chain.prismatic)  # J is the same everywhere
    if best.complete and not best.settled and not alike:
        notes.append("a better posture may have been missed; try more --starts.")
    converged = best.reached_best or not best.starts
    text = _posture_text(best, search)
    answer = partial(Answer, best.to_dict(), text, out if converged else None, notes)
    if not best.complete:
        asked = "" if starts is None else f" of {starts}"
        sentence = f"Interrupted: {best.starts}{asked} starts ended."
        return answer(failure=[sentence], status=INTERRUPTED)
    if not converged:
        sentence = "Not solved: no start converged, and nothing is written."
        return answer(failure=[sentence])
    return answer()


def _posture_text(best: Posture, search: Any) -> str:
    how: dict[str, object] = {"formulation": search.formulation}
    if best.starts:
        how |= {} if search.failures is None else {"goal": search.goal}
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
    parts = [_robot_text(best.assessment, how, source)]
    parts += [] if best.failures is None else [as_text(best.failures)]
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
        nearer = [f"{names} {least:.4g} m" for names, least in posture.clearance.nearer.items()]
        if nearer:
            lines["never so far apart"] = f"asked to keep {', '.join(nearer)}"
    return lines


def _after_failure(failures: Sequence[LockedReach]) -> str:
    lines = []
    for failure in failures:
        ranges = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in failure.ranges)
        line = {"locked": failure.joint, "% of range": failure.percent}
        lines.append(line | {"pose within reach where it locks at": ranges or "only here"})
    return as_table(lines)


def codegen(
    robot: ArmOptions,
    *,
    out: Path = option("DIR", "Write NAME.c and NAME.h there.", Path()),
    name: str = option("NAME", "Of the files; the function is NAME_sigma.", "worst_case"),
) -> Answer:
    """Write a C function: worst-case singular value, its gradient, the worst joint.

    It needs no library, allocates no memory, and takes the same time at every posture. The
    Jacobian is that of measure-robot.
    """
    from lockedjoint.formulations.io.files import prepare_file, write_text
    from lockedjoint.robots.worst_case_code import check_name, worst_case_code

    check_name("--name", name)
    arm = robot.arm()
    files = out / f"{name}.h", out / f"{name}.c"
    for file in files:
        prepare_file(file, inputs=[robot.file])
    code, header = worst_case_code(arm, name)
    for file, text in zip(files, (header, code), strict=True):
        write_text(file, text)
    plain = {
        "robot": arm.chain.robot,
        "tip": arm.chain.tip,
        "function": f"double {name}_sigma(const double* q, double* gradient, int* joint)",
        "joints": list(arm.chain.names),
        "files": [str(file) for file in files],
    }
    return Answer(plain, notes=arm.chain.notes)


def _robot_text(assessment: RobotAssessment, above: Mapping[str, object], source: str) -> str:
    """Return the text of an assessment: robot, posture, each failure, dependence on ℓ.

    It begins with the values `above`; the configuration is from `source`.
    """
    hidden = ("failures", "structural", "by_length", "best_length", "jacobian", "notes")
    structural: dict[str, str] = {}
    for joint in assessment.structural:
        before = f"{structural[joint.kind]}. " if joint.kind in structural else ""
        structural[joint.kind] = before + joint.sentence
    values = {
        **above,
        **{k: v for k, v in vars(assessment).items() if k not in hidden and v not in ({}, "")},
        "at_limits": ", ".join(assessment.at_limits) or "none",
        "configuration is": source,
        **_rounded(assessment),
        "percent_of_reachable": f"{assessment.percent_of_reachable:.2f}",
        "worst_case_direction": _direction(assessment.worst_case_direction),
        **structural,
    }
    parts = [as_text(values), _failures(assessment.failures), _lengths(assessment)]
    return "\n\n".join(part for part in parts if part)


def _failures(failures: Sequence[Failure]) -> str:
    lines = [
        {
            "locked": failure.joints,
            "sigma left": _sigma(failure.sigma),
            **_direction(failure.direction),
        }
        for failure in failures[:_SHOWN]
    ]
    more = f"\n… and {len(failures) - _SHOWN} failures that leave more"
    return as_table(lines) + (more if len(failures) > _SHOWN else "")


def _lengths(assessment: RobotAssessment) -> str:
    if not assessment.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    chosen = assessment.best_length
    best = "" if chosen is None else f", the best {chosen.length:.4g} m"
    lines = [vars(row) | _rounded(row) for row in assessment.by_length]
    return f"by length{best}\n{as_table(lines)}"


def _rounded(assessment: RobotAssessment | AtLength) -> dict[str, object]:
    """Return the worst case and its share of the bound, without digits that are rounding."""
    return {
        "worst_case_sigma": _sigma(assessment.worst_case_sigma),
        "percent_of_bound": f"{assessment.percent_of_bound:.2f}",
    }


def _sigma(value: float) -> str:
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _direction(values: Mapping[str, float]) -> dict[str, str]:
    return {name: f"{value:+.3f}" for name, value in values.items()}
