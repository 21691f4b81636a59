"""``lockedjoint failures``: several and unequal failures, the best found beside the bound."""

from pathlib import Path

from formulations.commands.arguments import Json, Out, Seed, Starts, Workers
from formulations.commands.output import run_study


def failures(
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    out: Out = Path("failures"),
    as_json: Json = False,
) -> None:
    """Maximise what several or unequal failures leave, over a list of cases.

    Two and three joints locked at once on planar, positional and revolute arms; joints that
    never fail; joints that fail with unequal probabilities, by the expected and by the
    probability-weighted worst dexterity. Each beside a proved bound. Writes failures.csv,
    failures.md and jacobians.json into the output folder; until all rows are there they are in
    its subfolder incomplete, where Ctrl-C leaves what is done.
    """
    from formulations.studies.failures import study

    run_study(study(), out, as_json, seed=seed, starts=starts, workers=workers, bars=True)
