"""``lockedjoint bound``: how good any answer could be, a command for each quantity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from formulations.commands.arguments import (
    Joints,
    Json,
    Seed,
    TaskDimension,
    flag,
    option,
    progress,
)
from formulations.commands.output import QUESTIONED, as_table, as_text, show
from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.bounds.certified import Bound

app = typer.Typer(name="bound", rich_markup_mode=None)

Rigorous = Annotated[
    bool,
    typer.Option(
        "--rigorous",
        help="Write a certificate and verify it, all rounding errors bounded, so that the "
        "bound is a theorem. Minutes more; not with null-vector.",
    ),
]
CertificateFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="With --rigorous: where to keep the certificate, for `lockedjoint verify`.",
    ),
]


@app.callback(invoke_without_command=True)
def bound(context: typer.Context) -> None:
    """Bound how good any answer could be, by semidefinite programming.

    Alone: the bound (6) on the worst case of seven revolute joints with |v| at most 1, and
    which sharper bounds are on record.

    Bounds are numerical unless stated otherwise: computed in floating point, and what they
    prove is checked again from the solver's multipliers alone. The exact proof that no
    optimally failure-tolerant 7R Jacobian exists is `lockedjoint prove`.
    """
    if context.invoked_subcommand is None:
        worst_case(7, 6, None, None, False)


@app.command("worst-case")
def worst_case(
    joints: Joints = 7,
    task_dimension: TaskDimension = 6,
    trace: float | None = option(
        "T",
        "Any columns with ‖J‖_F² at most T; m by default, except with m = 6, see --lever-arm.",
        positive=True,
    ),
    lever_arm: float | None = option(
        "L",
        "Revolute joints with |v| at most L; 1 by default with m = 6 and no --trace.",
        positive=True,
    ),
    as_json: Json = False,
) -> None:
    """Bound the worst case after one locked joint: equation (6), a semidefinite program."""
    from formulations.bounds.worst_case import worst_case_bound

    if lever_arm is None and trace is None and task_dimension == 6:
        lever_arm = 1.0
    if lever_arm is None:
        free = float(task_dimension) if trace is None else trace
        plain = worst_case_bound(joints, (task_dimension,), (free,))
    elif task_dimension != 6 or trace is not None:
        allowed = "none with --trace or a --task-dimension other than 6"
        raise InputError("--lever-arm", lever_arm, allowed)
    elif not 1e-100 <= lever_arm <= 1e100:
        raise InputError("--lever-arm", lever_arm, "1e-100 to 1e100")
    else:
        traces = joints * lever_arm**2, float(joints)
        plain = worst_case_bound(joints, (3, 3), traces)
    if lever_arm == 1.0:
        plain = {**plain, "sharper": _sharper(joints)}
    _show(plain, as_json, _worst_case_text, decided=plain["singular_value_bound"] is not None)


@app.command("two-point")
def two_point(
    joints: Joints = 7, task_dimension: TaskDimension = 6, as_json: Json = False
) -> None:
    """Bound the worst case after two locked joints, from pairs of columns, ‖J‖_F² = n."""
    from formulations.bounds.two_point import two_point_bound

    limit = two_point_bound(task_dimension, joints, progress=progress)
    _show(limit.to_dict(), as_json)


@app.command()
def planar(
    joints: Joints = 7,
    locked: int = option("K", "Joints that lock at once.", 2, low=1),
    level: float | None = option(
        "X",
        "The value that is to be shown to be above all, ‖J‖_F² = n; by default what the"
        " atlas has, and 0.1 % more.",
        positive=True,
    ),
    manipulability: bool = flag(
        "--manipulability", "Of the least relative manipulability, not of the worst case."
    ),
    as_json: Json = False,
) -> None:
    """Prove that no planar Jacobian is better than --level, by branch and bound."""
    from formulations.atlas.collection import page_of
    from formulations.atlas.entry import Entry
    from formulations.bounds.planar import planar_bound

    measure: Literal["max-min", "manipulability"]
    measure = "manipulability" if manipulability else "max-min"
    if level is None:
        page = page_of(Entry("free-mean", 2, joints, locked, measure))
        if page is None:
            allowed = "a number: the atlas has no Jacobian of this size"
            raise InputError("--level", "none", allowed)
        level = 1.001 * float(page.value)
    limit = planar_bound(joints, locked, level, measure, progress=progress)
    progress("")
    plain = limit.to_dict()
    _show(plain, as_json, decided=plain["proved"])


@app.command()
def existence(
    joints: Joints = 7,
    task_dimension: TaskDimension = 6,
    order: int = option("K", "Order of the relaxation, 1 to 3.", 3, low=1, high=3),
    as_json: Json = False,
) -> None:
    """Relax by moments whether an optimally failure-tolerant Jacobian of revolutes exists."""
    from formulations.existence.relaxation import existence_relaxation

    plain = existence_relaxation(order, joints, task_dimension=task_dimension).to_dict()
    _show(plain, as_json, _existence_text, decided=plain["verdict"] != "undecided")


@app.command()
def residual(
    joints: Joints = 7,
    preset: str = option("NAME", "compact (half a minute) or tight (1.5 minutes).", "compact"),
    rigorous: Rigorous = False,
    out: CertificateFile = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Bound the residual of unit revolute joints from below, globally."""
    limit = _computed("residual", joints, rigorous, preset=preset, out=out, seed=seed)
    _show(limit, as_json, _rounded_outward)


@app.command("max-min")
def max_min(
    joints: Joints = 7,
    preset: str = option(
        "NAME", "localised (1.5 minutes) or null-vector (5 minutes, 4 GB).", "localised"
    ),
    rigorous: Rigorous = False,
    out: CertificateFile = None,
    free_levers: bool = flag(
        "--free-levers",
        "Revolute joints with lever arms |v| of mean square at most 1: the proved bound"
        " on record.",
    ),
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Bound the worst case of unit revolute joints after one locked joint, globally."""
    if (free_levers or joints > 7) and (rigorous or out is not None):
        allowed = "none with --free-levers, or for more than 7 joints: no certificate is needed"
        raise InputError("--rigorous or --out", "given", allowed)
    if free_levers:
        plain = _free_levers("max-min", joints, "mean square at most 1")
    else:
        plain = _computed(
            "max-min",
            joints,
            rigorous,
            preset=preset if joints <= 7 else None,
            out=out,
            seed=seed,
        )
    _show(plain, as_json, _rounded_outward)


@app.command()
def isotropy(joints: Joints = 7, as_json: Json = False) -> None:
    """Show the proved bound on isotropic arms of revolute joints with levers of any length.

    With unit lever arms none exists for seven joints: `lockedjoint prove`.
    """
    _show(_free_levers("isotropy", joints, "any"), as_json, _rounded_outward)


def _computed(quantity: str, joints: int, rigorous: bool, **options: Any) -> dict[str, Any]:
    """Return the bound on unit revolute joints, computed now; also of six, which are no arm."""
    from formulations.bounds.so3_moments.max_min_bound import max_min_bound
    from formulations.bounds.so3_moments.residual_bound import residual_bound

    compute = residual_bound if quantity == "residual" else max_min_bound
    limit = compute(joints=joints, rigorous=rigorous, progress=progress, **options)
    return dict(limit.to_dict())


def _show(
    plain: Mapping[str, Any],
    as_json: bool,
    text: Callable[[Mapping[str, Any]], str] = as_text,
    *,
    decided: bool = True,
) -> None:
    """Print a bound; exit status 1 if nothing was decided."""
    show(plain, as_json, text)
    if not decided:
        raise typer.Exit(QUESTIONED)


def _sharper(joints: int) -> list[dict[str, Any]]:
    """Return the bounds on record that are below (6) for revolute joints with |v| ≤ 1.

    Those with lever arms of mean square at most 1 hold for each of at most 1, too.
    """
    from formulations import measures

    plain = measures.sigma_bound(6, joints, 2.0 * joints) - 1e-9
    names = product(("max-min", "isotropy"), ("unit-revolute", "lever-revolute"))
    on_record = [_on_record(quantity, model, joints) for quantity, model in names]
    # Not a number where none exists.
    return [values for limit, values in on_record if not limit.value >= plain]


def _on_record(quantity: str, model: str, joints: int) -> tuple[Bound, dict[str, Any]]:
    from formulations.bounds.certified import best_known
    from formulations.joints.models import arm
    from formulations.registry import bound as certified_bound

    limit = certified_bound(quantity, arm(model, joints))
    best = best_known(quantity, model, joints)
    gap = None if best is None else limit.gap_percent(best)
    known = {"best_known": best, "gap_percent": gap}
    return limit, {"quantity": quantity, "model": model, **limit.to_dict(), **known}


def _free_levers(quantity: str, joints: int, lever_arms: str) -> dict[str, Any]:
    if joints < 7:
        raise InputError("--joints", joints, "at least 7 with free lever arms")
    _, values = _on_record(quantity, "lever-revolute", joints)
    value = values.pop("value")
    return {**values, "joints": joints, "lever_arms": lever_arms, "bound": value}


def _rounded_outward(plain: Mapping[str, Any]) -> str:
    """Return the text with a bound that holds as it is shown."""
    from formulations.io.pages import outward

    limit = outward(plain["bound"], 9, lower=plain["quantity"] == "residual")
    return as_text({**plain, "bound": limit})


def _worst_case_text(plain: Mapping[str, Any]) -> str:
    """Return the text of the bound (6) with the sharper bounds on record as a table."""
    text = as_text({k: v for k, v in plain.items() if k not in ("multipliers", "sharper")})
    if not plain.get("sharper"):
        return text
    lines = [
        {
            "on record, sharper": f"{row['quantity']}, {row['model']}",
            "bound": "none exists" if row["value"] is None else _above(row["value"]),
            "known by": row["kind"],
            "best found": row["best_known"],
            "gap %": row["gap_percent"],
        }
        for row in plain["sharper"]
    ]
    return f"{text}\n\n{as_table(lines)}\n\nThe gap is 100·|bound − found|/bound."


def _above(limit: float) -> str:
    from formulations.io.pages import outward

    return outward(limit, 7, lower=False)


def _existence_text(plain: Mapping[str, Any]) -> str:
    """Return the text of a relaxation of the existence question with its blocks as a table."""
    summary = {k: v for k, v in plain.items() if not isinstance(v, (list, tuple))}
    summary["free_moments"] = len(plain["free_moments"])
    return "\n\n".join(filter(None, (as_text(summary), as_table(plain["blocks"]))))
