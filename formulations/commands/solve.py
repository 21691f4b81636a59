"""``lockedjoint solve``: one formulation on one arm."""

from pathlib import Path
from typing import Annotated, Any

import typer

from formulations.commands import arguments as cli
from formulations.commands.arguments import flag, option
from formulations.commands.measure import jacobian_values
from formulations.commands.output import INTERRUPTED, as_text, end, rows_of, show

_NO_ANSWER = "the Jacobian shown is no answer, and nothing is written"


def solve(
    formulation: Annotated[
        str,
        typer.Argument(
            metavar="FORMULATION", help="residual, max-min, isotropy or manipulability."
        ),
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
        "ipopt; or fatrop, which is faster: for residual, and for max-min with --compiled, "
        "of unit-revolute joints.",
        "ipopt",
    ),
    compiled: cli.Compiled = False,
    time_limit: float | None = option(
        "SECONDS",
        "Time for each start, after which Ipopt stops it; by default no limit.",
        positive=True,
    ),
    out: Path | None = option("FILE", "Write the best Jacobian and its measures as JSON."),
    as_json: cli.Json = False,
) -> None:
    """Solve one formulation from random starts and measure the best answer.

    Exit status 1, and no file, if no start was solved.
    """
    from formulations.io.files import prepare_file
    from formulations.registry import formulation_of
    from formulations.solving.solve import arm_of
    from formulations.solving.solve import solve as solve_from_many_starts

    stated = formulation_of(formulation)
    built = arm_of(model, joints, task_dimension)
    unequal = failures.model(built.shape[1])
    prepare_file(out)
    settings: dict[str, Any] = {
        "locked": failures.locked if failures.locked > 1 else None,
        "failures": unequal,
        "goal": goal if goal != "worst" else None,
        "encoding": encoding,
        "from_residual_minima": from_residual_minima or None,
    }
    limit = {} if time_limit is None else {"max_wall_time": time_limit}
    outcome = solve_from_many_starts(
        stated,
        built,
        starts=starts,
        seed=seed,
        workers=workers,
        **settings,
        solver=solver,
        options=cli.ipopt_options(ipopt) | limit,
        compiled=compiled,
        progress=True,
    )
    if not outcome.records:
        raise KeyboardInterrupt
    best, hidden = outcome.best, ("records", "complete", "variant")
    plain = {
        **{k: v for k, v in outcome.to_dict().items() if k not in hidden},
        "score": best.score,
        "starts": len(outcome.records),
        "seed": seed,
        "start": best.index,
        "violation": best.violation,
        **({} if unequal is None else {"goal": goal}),
        **jacobian_values(best.jacobian, failures),
        "jacobian": best.jacobian.tolist(),
    }
    solved = outcome.verdict == "solved"
    summary = {**plain, "verdict": outcome.summary}
    show(plain, as_json, lambda _: _text(summary), out if solved else None)
    if not outcome.complete:
        ended = f"{len(outcome.records)} of {starts} starts ended"
        end(f"Interrupted: {ended}.", INTERRUPTED)
    if not solved:
        end(f"{outcome.verdict.capitalize()}: {_NO_ANSWER}.")


def _text(plain: dict[str, Any]) -> str:
    rows = rows_of(plain.pop("jacobian"), 9)
    return f"{as_text(plain)}\n\njacobian\n{rows}"
