"""``lockedjoint bound``: how good any answer could be, a command for each quantity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Literal

import typer

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import flag, option, register
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_table, as_text, progress, say
from lockedjoint.nlp.errors import InputError

app = typer.Typer(name="bound", rich_markup_mode=None)


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
        worst_case(7, 6, None, None).show(as_json=False)
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
    joints: cli.Joints = 7,
    task_dimension: cli.TaskDimension = 6,
    trace: float | None = option(
        "T",
        "Of all Jacobians with ‖J‖_F² at most T; by default m, or with m = 6 as --lever-arm"
        " says.",
        positive=True,
    ),
    lever_arm: float | None = option(
        "L",
        "Of revolute joints with |v| at most L; by default 1 with m = 6 and no --trace.",
        positive=True,
    ),
) -> Answer:
    """Bound the worst case after one locked joint by equation (6)."""
    from fractions import Fraction

    from lockedjoint.formulations.bounds.closed_form import block_trace_bound, root_above

    if lever_arm is None and trace is None and task_dimension == 6:
        lever_arm = 1.0
    sizes: tuple[int, ...]
    traces: tuple[float, ...]
    if lever_arm is None:
        sizes, traces = (task_dimension,), (float(task_dimension) if trace is None else trace,)
    elif task_dimension != 6 or trace is not None:
        allowed = "none with --trace or a --task-dimension other than 6"
        raise InputError("--lever-arm", lever_arm, allowed)
    elif not 1e-100 <= lever_arm <= 1e100:
        raise InputError("--lever-arm", lever_arm, "1e-100 to 1e100")
    else:
        sizes, traces = (3, 3), (joints * lever_arm**2, float(joints))
    t = block_trace_bound(joints, sizes, traces)
    return Answer(
        {
            "kind": "closed form",
            "joints": joints,
            "task_dimension": task_dimension,
            "trace": sum(traces),
            "eigenvalue_bound": t,
            "singular_value_bound": root_above(Fraction(t)),
        }
    )


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
    manipulability: bool = flag(
        "--manipulability", "Bound the least relative manipulability, not the worst case."
    ),
) -> Answer:
    """Prove that no Jacobian of two rows is better than --level, by branch and bound."""
    from lockedjoint.formulations.atlas.collection import page_of
    from lockedjoint.formulations.atlas.entry import Entry
    from lockedjoint.formulations.bounds.planar import planar_bound

    measure: Literal["max-min", "manipulability"]
    measure = "manipulability" if manipulability else "max-min"
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
) -> Answer:
    """Prove a bound on the residual ½‖JJᵀ − (n/3)I‖² of unit revolute joints, globally.

    A certificate is written and verified from its file, all rounding errors bounded: minutes.
    """
    from lockedjoint.formulations.bounds.so3_moments.unit_revolute_bounds import residual_bound

    return _proved(partial(residual_bound, joints), out, seed)


@register(app)
def max_min(out: Path | None = _OUT, seed: cli.Seed = 0) -> Answer:
    """Prove a bound on the worst case of seven unit revolute joints, globally.

    As of the residual. It takes a quarter of an hour and 4 GB.
    """
    from lockedjoint.formulations.bounds.so3_moments.unit_revolute_bounds import max_min_bound

    return _proved(max_min_bound, out, seed)


def _proved(compute: Callable[..., dict[str, Any]], out: Path | None, seed: int) -> Answer:
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    with LocalExecutor(default_workers()) as executor:
        plain = compute(seed=seed, progress=progress, out=out, executor=executor)
    return Answer(plain, lambda plain: as_text(_rounded_outward(plain)))


def _rounded_outward(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with a bound that holds as it is shown."""
    from lockedjoint.formulations.io.rounding import outward

    limit, lower = plain["bound"], plain["quantity"] == "residual"
    return {
        **plain,
        "bound": "none exists" if limit is None else outward(limit, 9, lower=lower),
    }
