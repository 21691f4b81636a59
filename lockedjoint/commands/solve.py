"""``lockedjoint solve``: a formulation on an arm that is to be designed.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lockedjoint.commands.measure import jacobian_values
from lockedjoint.commands.output import INTERRUPTED, Answer, as_text, rows_of
from lockedjoint.commands.shared import Failures

if TYPE_CHECKING:
    from lockedjoint.formulations.solving.outcome import Outcome

# Names under which values are printed: this gap is that of σ to eq. (6), as `compare` names it.
_SHOWN_AS = {"gap_percent": "sigma_gap_percent"}
# Part of the sentence that ends the command if no start was solved.
_NO_ANSWER = "the Jacobian shown is no answer, and nothing is written"


def solve(
    formulation: str,
    failing: Failures,
    model: str = "unit-revolute",
    joints: int | None = None,
    task_dimension: int = 6,
    maximise: str = "worst",
    setting: Mapping[str, object] | None = None,
    starts: int = 100,
    seed: int = 0,
    workers: int | None = None,
    ipopt: Mapping[str, object] | None = None,
    solver: str = "ipopt",
    time_limit: float | None = None,
    out: Path | None = None,
) -> Answer:
    """Solve one formulation from random starts and measure the best answer.

    Exit status 1, and no file, if no start was solved.

    Parameters
    ----------
    formulation
        What is optimised: residual, max-min, isotropy, manipulability or condition, or one that
        was registered.
    model
        It is unit-revolute, lever-revolute, lever-revolute-each, prismatic, free or free-mean;
        or a mix such as 'lever-revolute(length=0.3):6,prismatic(speed=0.5):2', with lengths,
        speeds or norms in brackets, 1 by default, and the number of joints after the colon.
    joints
        By default as many as a mix has, or 7.
    maximise
        What max-min maximises where failures have unequal probabilities: worst, the least of
        σ·(largest probability)/(probability) over the failures, or expected, the mean of σ
        weighted with the probabilities.
    setting
        A setting of the formulation. May be repeated. Those of max-min are encoding=NAME, of
        the eigenvalue constraints (two-stage, schur-complement, shared-factor,
        principal-minors, factor-per-deletion or positive-factor-per-deletion; by default
        two-stage; shared-factor for several failures at once; positive-factor-per-deletion for
        unequal failures), from_residual_minima=true, and largest_defect=X, the largest defect
        of isotropy.
    solver
        Name of the solver: ipopt; or fatrop, which is faster and compiled, for residual, and
        for max-min of unit-revolute joints.
    time_limit
        Time in seconds after which a start ends; by default there is no limit.
    out
        The file that is written: the best Jacobian and its measures, as JSON.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.formulations.registry import formulation_of
    from lockedjoint.formulations.solving import solve as solving

    stated = formulation_of(formulation)
    built = solving.arm_of(model, joints, task_dimension)
    unequal = failing.model([""] * built.shape[1])
    prepare_file(out)
    limit = {} if time_limit is None else {"max_wall_time": time_limit}
    settings: dict[str, Any] = {
        "failures": unequal or (failing.failures if failing.failures > 1 else None),
        "maximise": maximise if maximise != "worst" else None,
        **(setting or {}),
    }
    outcome = solving.solve(
        stated,
        built,
        starts=starts,
        seed=seed,
        workers=workers,
        **settings,
        solver=solver,
        options={**(ipopt or {}), **limit},
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
        **({} if unequal is None else {"maximise": maximise}),
        **jacobian_values(best.jacobian, failing),
    }
    shown = {_SHOWN_AS.get(name, name): value for name, value in plain.items()}
    text = f"{as_text({**shown, 'verdict': outcome.summary})}\n\njacobian\n"
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
    known = outcome.case.formulation.bound(outcome.arm, outcome.case.failures)
    if known is None or not outcome.reached:
        return {}
    return {
        "proved_bound": known.value,
        "certificate": known.kind,
        "bound_gap_percent": known.gap_percent(outcome.best.score),
    }
