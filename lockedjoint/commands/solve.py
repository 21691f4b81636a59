"""``lockedjoint solve`` and ``measure``: a formulation on an arm; the measures of a matrix."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import argument, flag, option
from lockedjoint.commands.output import INTERRUPTED, Answer, as_text, rows_of

if TYPE_CHECKING:
    from lockedjoint.formulations.solving.outcome import Outcome
    from lockedjoint.nlp.arrays import FloatArray

_NO_ANSWER = "the Jacobian shown is no answer, and nothing is written"


def solve(
    formulation: Annotated[
        str,
        argument("FORMULATION", "residual, max-min, isotropy, manipulability or condition."),
    ],
    *,
    model: str = option(
        "MODEL",
        "Column model: unit-revolute, lever-revolute, lever-revolute-each, prismatic, "
        "free or free-mean; or a mix such as "
        "'lever-revolute(length=0.3):6,prismatic(speed=0.5):2', with lengths, speeds or"
        " norms in brackets, 1 by default, and the number of joints after the colon.",
        "unit-revolute",
    ),
    joints: int | None = option(
        "N",
        "Number of joints n, above m; by default of the mix, or 7.",
        low=2,
        high=cli.MOST_JOINTS,
    ),
    task_dimension: cli.TaskDimension = 6,
    failures: cli.FailureOptions,
    goal: cli.Goal = "worst",
    encoding: str | None = option(
        "NAME",
        "Eigenvalue constraints of max-min: two-stage, schur-complement, shared-factor,"
        " principal-minors, factor-per-deletion or positive-factor-per-deletion; by "
        "default two-stage; shared-factor for several locked joints; "
        "positive-factor-per-deletion for unequal failures.",
    ),
    from_residual_minima: bool = flag(
        "--from-residual-minima", "Start max-min from residual minima."
    ),
    starts: cli.Starts = 100,
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    ipopt: cli.Ipopt = None,
    solver: str = option(
        "NAME",
        "ipopt; or fatrop, which is faster and compiled: for residual, and for max-min of "
        "unit-revolute joints.",
        "ipopt",
    ),
    time_limit: float | None = option(
        "SECONDS",
        "Time for each start, after which Ipopt stops it; by default no limit.",
        positive=True,
    ),
    out: Path | None = option("FILE", "Write the best Jacobian and its measures as JSON."),
) -> Answer:
    """Solve one formulation from random starts and measure the best answer.

    Exit status 1, and no file, if no start was solved.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.formulations.registry import formulation_of
    from lockedjoint.formulations.solving import solve as solving

    stated = formulation_of(formulation)
    built = solving.arm_of(model, joints, task_dimension)
    unequal = failures.model([""] * built.shape[1])
    prepare_file(out)
    limit = {} if time_limit is None else {"max_wall_time": time_limit}
    settings: dict[str, Any] = {
        "locked": failures.locked if failures.locked > 1 else None,
        "failures": unequal,
        "goal": goal if goal != "worst" else None,
        "encoding": encoding,
        "from_residual_minima": from_residual_minima or None,
    }
    outcome = solving.solve(
        stated,
        built,
        starts=starts,
        seed=seed,
        workers=workers,
        **settings,
        solver=solver,
        options=cli.ipopt_options(ipopt) | limit,
        progress=True,
    )
    if not outcome.records:
        raise KeyboardInterrupt
    best, hidden = outcome.best, ("records", "complete", "variant")
    plain = {
        **{k: v for k, v in outcome.to_dict().items() if k not in hidden},
        "score": best.score,
        **({} if unequal else _proved(outcome)),
        "starts": len(outcome.records),
        "seed": seed,
        "start": best.index,
        "violation": best.violation,
        **({} if unequal is None else {"goal": goal}),
        **_jacobian_values(best.jacobian, failures),
    }
    text = f"{as_text({**plain, 'verdict': outcome.summary})}\n\njacobian\n"
    plain["jacobian"] = best.jacobian.tolist()
    text += rows_of(plain["jacobian"], 9)
    solved = outcome.verdict == "solved"
    answer = partial(Answer, plain, text, out if solved else None)
    if not outcome.complete:
        ended = f"{len(outcome.records)} of {starts} starts ended"
        return answer(failure=[f"Interrupted: {ended}."], status=INTERRUPTED)
    if not solved:
        verdict = outcome.verdict.capitalize()
        return answer(failure=[f"{verdict}: {_NO_ANSWER}."])
    return answer()


def _proved(outcome: Outcome) -> dict[str, Any]:
    """Return the bound that is proved and the gap, named as `compare` names them."""
    known = outcome.case.formulation.bound(outcome.arm, outcome.case.locked)
    if known is None or not outcome.reached:
        return {}
    return {
        "certified_bound": known.value,
        "certificate": known.kind,
        "certified_gap_percent": known.gap_percent(outcome.best.score),
    }


def measure(
    file: cli.JacobianFile,
    failures: cli.FailureOptions,
    tolerance: float = option(
        "TOL",
        "Relative tolerance of the verdict 'optimally failure tolerant'.",
        1e-6,
        positive=True,
    ),
) -> Answer:
    """Measure the failure tolerance of a Jacobian.

    Reads a matrix from CSV, NPY, NPZ or JSON (a list of rows, an object with the key
    "jacobian", or a list of such objects as in jacobians.json) and prints its singular values,
    its worst case after locked joints with the joints and direction that realise it, the
    bound, its isotropy, and whether it is optimally failure tolerant. Joints are counted from
    0. Of several locked joints the bound is the mean over failures; the sharpest one known of
    all Jacobians of this shape and norm is shown too. With failure probabilities or joints that
    never fail also the expected dexterity and the probability-weighted worst case.
    """
    from lockedjoint.formulations.measures.read_jacobians import read_jacobians

    rows = [
        {"name": name, **_jacobian_values(matrix, failures, tolerance)}
        for name, matrix in read_jacobians(file)
    ]
    return Answer(rows if len(rows) > 1 else rows[0], "\n\n".join(map(as_text, rows)))


def _jacobian_values(
    jacobian: FloatArray, failures: cli.FailureOptions, tolerance: float = 1e-6
) -> dict[str, Any]:
    """Return what `measure` shows of a Jacobian, by name."""
    from lockedjoint.formulations.bounds.certified import sharpest_worst_case_of
    from lockedjoint.formulations.bounds.unequal_failures import assess_failures
    from lockedjoint.formulations.measures.assessment import measure as measured

    assessment = measured(jacobian, failures.locked, tolerance)
    values = assessment.to_dict()
    if failures.locked > 1:
        limit = sharpest_worst_case_of(jacobian, failures.locked)
        values |= {
            "sharpest_bound": limit.value,
            "sharpest_bound_kind": limit.kind,
            "gap_to_sharpest_percent": limit.gap_percent(assessment.worst_case_sigma),
        }
    if model := failures.model([""] * jacobian.shape[1]):
        known = failures.probabilities_known
        values |= assess_failures(jacobian, model, probabilities_known=known)
    return values
