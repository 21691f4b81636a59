"""``lockedjoint bound``: how good any answer could be, a command for each quantity."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import option, register
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_table, as_text, progress, say
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.formulations.joints.arm import Arm

app = typer.Typer(name="bound", rich_markup_mode=None)


_MOMENT_SOLVER = option(
    "NAME",
    "predictor-corrector, our dense method; or a solver of semidefinite programs in cvxpy, "
    "such as clarabel, which takes ten times as long.",
    "predictor-corrector",
)
_OUT = option("FILE", "Where to keep the certificate, for `lockedjoint verify`.")


@app.callback(invoke_without_command=True)
def bound(context: typer.Context) -> None:
    """Bound how good any answer could be.

    Alone: the bound (6) on the worst case of seven revolute joints with |v| at most 1, and the
    sharper bounds on record.

    All are proved. The exact proof that no optimally failure-tolerant 7R Jacobian exists is
    `lockedjoint prove`.
    """
    if context.invoked_subcommand is None:
        nothing = {"model": None, "trace": None, "lever_arm": None}
        alone = cli.FailureOptions(1, None, None)
        worst_case(
            joints=7, task_dimension=6, **nothing, solver="CLARABEL", failures=alone
        ).show(as_json=False)
        say("")
        record(7).show(as_json=False)


@register(app)
def record(joints: cli.Joints = 7) -> Answer:
    """List the bounds on record for revolute joints, and the best values known.

    Of unit-revolute joints, whose lever arms |v| are 1, and of lever-revolute ones, whose lever
    arms have a mean square of at most 1; what is isotropic may have lever arms of any length.
    """
    from lockedjoint.formulations.bounds.certified import best_known
    from lockedjoint.formulations.joints.models import arm
    from lockedjoint.formulations.registry import bound as certified_bound

    rows, models = [], ("unit-revolute", "lever-revolute")
    for quantity, model in product(("residual", "max-min", "isotropy"), models):
        limit = certified_bound(quantity, arm(model, joints))
        best = best_known(quantity, model, joints)
        row = {"quantity": quantity, "model": model, "bound": limit.to_dict()["value"]}
        gap = None if best is None else limit.gap_percent(best)
        rows.append(row | {"kind": limit.kind, "best_known": best, "gap_percent": gap})
    gaps = "The gap is 100·|bound − best known|/bound."
    return Answer(rows, f"{as_table(list(map(_rounded_outward, rows)))}\n\n{gaps}")


@register(app)
def worst_case(
    *,
    joints: cli.Joints = 7,
    task_dimension: cli.TaskDimension = 6,
    model: str | None = option(
        "MODEL", "A column model, see docs/howto/bound_an_arm.md; by default --lever-arm."
    ),
    trace: float | None = option(
        "T", "Of all Jacobians with ‖J‖_F² at most T; by default m unless m = 6.", positive=True
    ),
    lever_arm: float | None = option(
        "L", "Of revolute joints with |v| at most L; by default 1 with m = 6.", positive=True
    ),
    solver: str = option("NAME", "A solver of semidefinite programs in cvxpy.", "CLARABEL"),
    failures: cli.FailureOptions,
) -> Answer:
    """Bound the worst case after locked joints by a semidefinite program in cvxpy.

    The solver's value is numerical. Its multipliers become fractions, and what these prove is
    the bound. Beside it: equation (6), and the sharpest bound known, by whatever proof.
    """
    from lockedjoint.formulations.bounds import certified
    from lockedjoint.formulations.bounds.relaxed import TooLargeError, relaxed
    from lockedjoint.formulations.measures import sigma_bound

    arm = _arm(joints, task_dimension, model, trace, lever_arm)
    m, n = arm.shape
    unequal = failures.model([""] * n)
    known = (
        certified.largest_worst_case(arm, failures.locked)
        if unequal is None
        else certified.largest_weighted_worst_case(arm, unequal)
    )
    plain: dict[str, Any] = {
        "joints": n,
        "task_dimension": m,
        "trace": arm.largest_trace,
        "sharpest": known.value,
        "sharpest_kind": known.kind,
    }
    if unequal is None:
        plain["equation_6"] = sigma_bound(m, n, arm.largest_trace, failures.locked)
    try:
        found = relaxed(arm, unequal or failures.locked, solver=solver).to_dict()
    except TooLargeError as error:
        found = {"bound": None, "status": str(error)}
    plain |= {"relaxation": found.pop("bound")} | found
    return Answer(plain, lambda plain: as_text(_rounded_up(plain)))


def _rounded_up(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with bounds that hold as they are shown."""
    from lockedjoint.formulations.io.rounding import outward

    bounds = ("sharpest", "equation_6", "relaxation")
    shown = {
        name: outward(plain[name], 9, lower=False)
        for name in bounds
        if plain.get(name) is not None
    }
    return {**plain, **shown}


def _arm(
    joints: int,
    task_dimension: int,
    model: str | None,
    trace: float | None,
    lever_arm: float | None,
) -> Arm:
    """Return the arm that the options of `worst_case` describe."""
    from lockedjoint.formulations.joints.arm import Arm
    from lockedjoint.formulations.joints.kinds import FreeColumn, LeverRevolute
    from lockedjoint.formulations.joints.models import arm

    given = {"--trace": trace, "--lever-arm": lever_arm, "--model": model}
    stated = [name for name, value in given.items() if value is not None]
    if len(stated) > 1:
        raise InputError(stated[1], given[stated[1]], f"none with {stated[0]}")
    if model is not None:
        return arm(model, None if ":" in model else joints, task_dimension)
    if trace is not None or (lever_arm is None and task_dimension != 6):
        norm = math.sqrt((task_dimension if trace is None else trace) / joints)
        return Arm.of(FreeColumn(task_dimension, norm, "mean"), joints)
    if task_dimension != 6:
        raise InputError("--lever-arm", lever_arm, "none with a --task-dimension other than 6")
    return Arm.of(LeverRevolute(lever_arm or 1.0, "each"), joints)


@register(app)
def two_point(joints: cli.Joints = 7, task_dimension: cli.TaskDimension = 6) -> Answer:
    """Bound the worst case after two locked joints, of columns with ‖J‖_F² = n.

    It follows from conditions on pairs of columns. n must be at least m + 2.
    """
    from lockedjoint.formulations.bounds.two_point import two_point_bound

    return Answer(two_point_bound(task_dimension, joints, progress=progress).to_dict())


@register(app)
def planar(
    joints: cli.Joints = 7,
    locked: int = option("K", "Joints that lock at once.", 2, low=1),
    level: float | None = option(
        "X",
        "The value that no Jacobian with ‖J‖_F² = n is to reach; by default 0.1 % more than"
        " the atlas has.",
        positive=True,
    ),
    measure: Literal["max-min", "manipulability", "condition"] = option(
        None,
        "What is bounded: the worst case, the least relative manipulability, or the least"
        " ratio of the smallest to the largest singular value.",
        "max-min",
    ),
) -> Answer:
    """Prove that no Jacobian of two rows is better than --level, by branch and bound."""
    from lockedjoint.formulations.atlas.collection import page_of
    from lockedjoint.formulations.atlas.entry import Entry
    from lockedjoint.formulations.bounds.planar import planar_bound

    if level is None:
        page = page_of(Entry("free-mean", 2, joints, locked, measure))
        if page is None:
            allowed = "a number: the atlas has no Jacobian of this size"
            raise InputError("--level", "none", allowed)
        level = 1.001 * float(page.value)
    plain = planar_bound(joints, locked, level, measure, progress=progress).to_dict()
    return Answer(plain, status=0 if plain["proved"] else UNSUCCESSFUL)


@register(app)
def residual(
    joints: int = option("N", "Number of unit revolute joints n.", 7, low=6, high=9),
    out: Path | None = _OUT,
    seed: cli.Seed = 0,
    solver: str = _MOMENT_SOLVER,
) -> Answer:
    """Prove a bound on the residual ½‖JJᵀ − (n/3)I‖² of unit revolute joints, globally.

    A certificate is written and verified from its file, all rounding errors bounded: minutes.
    """
    from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import residual_bound

    return _proved(partial(residual_bound, joints), out, seed, solver)


@register(app)
def max_min(
    out: Path | None = _OUT, seed: cli.Seed = 0, solver: str = _MOMENT_SOLVER
) -> Answer:
    """Prove a bound on the worst case of seven unit revolute joints, globally.

    As of the residual. It takes a quarter of an hour and 4 GB.
    """
    from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import max_min_bound

    return _proved(max_min_bound, out, seed, solver)


def _proved(
    compute: Callable[..., dict[str, Any]], out: Path | None, seed: int, solver: str
) -> Answer:
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    with LocalExecutor(default_workers()) as executor:
        plain = compute(seed=seed, solver=solver, progress=progress, out=out, executor=executor)
    return Answer(plain, lambda plain: as_text(_rounded_outward(plain)))


def _rounded_outward(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with a bound that holds as it is shown."""
    from lockedjoint.formulations.io.rounding import outward

    limit, lower = plain["bound"], plain["quantity"] == "residual"
    return {
        **plain,
        "bound": "none exists" if limit is None else outward(limit, 9, lower=lower),
    }
