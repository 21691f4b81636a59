"""``lockedjoint solve``: one formulation on one arm."""

from pathlib import Path
from typing import Annotated, Any

import typer

from formulations.commands.arguments import (
    MOST_JOINTS,
    Compiled,
    Goal,
    Ipopt,
    Json,
    Locked,
    NeverFails,
    Probabilities,
    Seed,
    Starts,
    TaskDimension,
    Workers,
    failure_model,
    ipopt_options,
    positive_option,
    whole_option,
)
from formulations.commands.output import INTERRUPTED, as_text, sharpest_bound, show


def solve(
    formulation: Annotated[
        str,
        typer.Argument(
            metavar="FORMULATION", help="residual, max-min, isotropy or manipulability."
        ),
    ],
    model: Annotated[
        str,
        typer.Option(
            help="Column model: unit-revolute, lever-revolute, lever-revolute-each, prismatic, "
            "free or free-mean; or a mix such as "
            "'lever-revolute(length=0.3):6,prismatic(speed=0.5):2', with lengths, speeds or "
            "norms in brackets, 1 by default, and the number of joints after the colon."
        ),
    ] = "unit-revolute",
    joints: Annotated[
        int | None,
        whole_option(
            2, "N", "Number of joints n, above m.", MOST_JOINTS, show_default="of the mix, or 7"
        ),
    ] = None,
    task_dimension: TaskDimension = 6,
    locked: Locked = 1,
    failure_probabilities: Probabilities = None,
    never_fails: NeverFails = None,
    goal: Goal = "worst",
    encoding: Annotated[
        str | None,
        typer.Option(
            help="Eigenvalue constraints of max-min: two-stage, schur-complement, "
            "shared-factor, principal-minors, factor-per-deletion or "
            "positive-factor-per-deletion.",
            show_default="two-stage; shared-factor for several locked joints; "
            "positive-factor-per-deletion for unequal failures",
        ),
    ] = None,
    from_residual_minima: Annotated[
        bool,
        typer.Option("--from-residual-minima", help="Start max-min from residual minima."),
    ] = False,
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    ipopt: Ipopt = None,
    solver: Annotated[
        str,
        typer.Option(
            help="ipopt; or fatrop, faster: residual, and max-min compiled, of unit-revolute "
            "joints."
        ),
    ] = "ipopt",
    compiled: Compiled = False,
    time_limit: Annotated[
        float | None,
        positive_option(
            "SECONDS", "Time for a start, after which Ipopt stops it.", show_default="no limit"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the best Jacobian and its measures as JSON."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Solve one formulation from random starts and measure the best answer."""
    from formulations.bounds.unequal_failures import assess_failures
    from formulations.joints.models import arm
    from formulations.measures.assessment import measure
    from formulations.registry import formulation as formulation_of
    from formulations.solving.solve import solve as solve_from_many_starts
    from nlp.files import prepare_file

    stated = formulation_of(formulation)
    built = arm(model, 7 if joints is None and ":" not in model else joints, task_dimension)
    failures = failure_model(failure_probabilities, never_fails, built.shape[1], locked)
    if out is not None:
        prepare_file(out)
    settings: dict[str, tuple[Any, Any]] = {
        "locked": (locked, 1),
        "failures": (failures, None),
        "goal": (goal, "worst"),
        "encoding": (encoding, None),
        "from_residual_minima": (from_residual_minima, False),
    }
    outcome = solve_from_many_starts(
        stated,
        built,
        starts=starts,
        seed=seed,
        workers=workers,
        **{name: value for name, (value, default) in settings.items() if value != default},
        solver=solver,
        options=ipopt_options(ipopt),
        compiled=compiled,
        time_limit=time_limit,
        progress=True,
    )
    if not outcome.records:
        raise KeyboardInterrupt
    shown = outcome.best
    found = {
        "formulation": formulation,
        "model": model,
        "verdict": outcome.verdict,
        "score": shown.score,
        "starts": len(outcome.records),
        "reached_best": len(outcome.reached),
        "status_counts": outcome.status_counts,
        "seed": seed,
        "start": shown.index,
        "violation": shown.violation,
        **measure(shown.jacobian, locked).to_dict(),
    }
    if locked > 1:
        found |= sharpest_bound(shown.jacobian, locked)
    if failures is not None:
        known = failure_probabilities is not None
        unequal = assess_failures(shown.jacobian, failures, probabilities_known=known)
        found |= {"goal": goal, **unequal}
    found["jacobian"] = shown.jacobian.tolist()
    show(found, as_json, lambda plain: _text({**plain, "verdict": outcome.summary}), out)
    if not outcome.complete:
        ended = f"{len(outcome.records)} of {starts} starts ended"
        typer.echo(f"Interrupted: {ended}.", err=True)
        raise typer.Exit(INTERRUPTED)


def _text(found: dict[str, Any]) -> str:
    rows = "\n".join("  ".join(f"{x: .9f}" for x in line) for line in found.pop("jacobian"))
    return f"{as_text(found)}\n\njacobian\n{rows}"
