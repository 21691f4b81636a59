"""``lockedjoint bound``: how good any answer could be."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from formulations.commands.arguments import (
    Joints,
    Json,
    Seed,
    TaskDimension,
    positive_option,
    progress,
    refuse_unused,
    whole_option,
)
from formulations.commands.bound_text import (
    existence_text,
    rounded_outward,
    without_multipliers,
)
from formulations.commands.output import as_text, show
from nlp.errors import InputError

UNDECIDED = 1


class Quantity(StrEnum):
    """What can be bounded."""

    WORST_CASE = "worst-case"
    TWO_POINT = "two-point"
    PLANAR = "planar"
    EXISTENCE = "existence"
    RESIDUAL = "residual"
    MAX_MIN = "max-min"
    ISOTROPY = "isotropy"


# Options that only some quantities use; given with another quantity they are refused.
_UNIT_REVOLUTE = (Quantity.RESIDUAL, Quantity.MAX_MIN)
_USED_BY = {
    "task_dimension": (Quantity.WORST_CASE, Quantity.TWO_POINT, Quantity.EXISTENCE),
    "trace": (Quantity.WORST_CASE,),
    "lever_arm": (Quantity.WORST_CASE,),
    "order": (Quantity.EXISTENCE,),
    "preset": _UNIT_REVOLUTE,
    "rigorous": _UNIT_REVOLUTE,
    "out": _UNIT_REVOLUTE,
    "free_levers": (Quantity.MAX_MIN, Quantity.ISOTROPY),
    "seed": _UNIT_REVOLUTE,
    "locked": (Quantity.PLANAR,),
    "level": (Quantity.PLANAR,),
    "manipulability": (Quantity.PLANAR,),
    "solver": (Quantity.WORST_CASE, Quantity.TWO_POINT, Quantity.EXISTENCE),
}


def bound(
    context: typer.Context,
    quantity: Annotated[
        Quantity,
        typer.Option(
            help="worst-case: eq. (6) as a semidefinite program. two-point: the worst case "
            "after two locked joints, from pairs of columns, ‖J‖_F² = n. planar: that no "
            "planar J is better than --level, by branch and bound. existence: the moment "
            "relaxation of the question whether an optimally failure-tolerant Jacobian of "
            "revolute joints exists. residual, max-min: global bounds for unit revolute "
            "joints. isotropy: the worst case if isotropic, with --free-levers."
        ),
    ] = Quantity.WORST_CASE,
    joints: Joints = 7,
    task_dimension: TaskDimension = 6,
    trace: Annotated[
        float | None,
        positive_option(
            "T",
            "worst-case: any columns with ‖J‖_F² at most T; m by default, except with "
            "m = 6, see --lever-arm.",
            show_default=False,
        ),
    ] = None,
    lever_arm: Annotated[
        float | None,
        positive_option(
            "L",
            "worst-case: arms of revolute joints with |v| at most L; 1 by default with m = 6.",
            show_default=False,
        ),
    ] = None,
    order: Annotated[
        int, whole_option(1, "K", "existence: order of the relaxation, 1 to 3.", 3)
    ] = 3,
    preset: Annotated[
        str | None,
        typer.Option(
            help="residual: compact (by default, half a minute) or tight (1.5 minutes). "
            "max-min: localised (by default, 1.5 minutes) or null-vector (5 minutes, 4 GB).",
            show_default=False,
        ),
    ] = None,
    rigorous: Annotated[
        bool,
        typer.Option(
            "--rigorous",
            help="residual, max-min: write a certificate and verify it, all rounding errors "
            "bounded, so that the bound is a theorem. Minutes more; not with null-vector.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="residual, max-min, with --rigorous: where to keep the certificate (JSON), "
            "for `lockedjoint verify`.",
            show_default=False,
        ),
    ] = None,
    free_levers: Annotated[
        bool,
        typer.Option(
            "--free-levers",
            help="max-min: revolute joints with lever arms |v| of mean square at most 1; "
            "isotropy: of any length. From the proved bounds on record.",
        ),
    ] = False,
    locked: Annotated[
        int | None,
        whole_option(1, "K", "planar: joints that lock at once; 2 by default."),
    ] = None,
    level: Annotated[
        float | None,
        positive_option(
            "X",
            "planar: the value that is to be shown to be above all, ‖J‖_F² = n; by "
            "default what the atlas has, and 0.1 % more.",
            show_default=False,
        ),
    ] = None,
    manipulability: Annotated[
        bool,
        typer.Option(
            "--manipulability",
            help="planar: of the least relative manipulability, not of the worst case.",
        ),
    ] = False,
    seed: Seed = 0,
    solver: Annotated[
        str,
        typer.Option(help="worst-case, two-point, existence: conic solver, by cvxpy's name."),
    ] = "CLARABEL",
    as_json: Json = False,
) -> None:
    """Bound how good any answer could be, by semidefinite programming.

    Without options: the bound (6) on the worst case of seven revolute joints with |v| at most
    1, and which sharper bounds are on record.

    Bounds are numerical unless stated otherwise: computed in floating point, and what they
    prove is checked again from the solver's multipliers alone. The exact proof that no
    optimally failure-tolerant 7R Jacobian exists is `lockedjoint prove`.
    """
    names = [name for name, quantities in _USED_BY.items() if quantity not in quantities]
    refuse_unused(context, names, f"--quantity {quantity}")
    if quantity is Quantity.MAX_MIN and joints > 7:
        reason = "more than 7 joints: --quantity max-min is a closed form there"
        refuse_unused(context, ("preset", "rigorous", "out", "seed"), reason)
    if quantity is Quantity.ISOTROPY and not free_levers:
        allowed = (
            "isotropy with --free-levers; for unit lever arms there is `lockedjoint prove`"
        )
        raise InputError("--quantity", str(quantity), allowed)
    if free_levers:
        refuse_unused(context, ("preset", "rigorous", "out", "seed"), "--free-levers")
        show(_free_levers(quantity, joints), as_json, rounded_outward)
        return
    text: Callable[[Mapping[str, Any]], str] = as_text
    if quantity is Quantity.EXISTENCE:
        from formulations.existence.relaxation import existence_relaxation

        plain = existence_relaxation(
            order, joints, task_dimension=task_dimension, solver=solver
        ).to_dict()
        text = existence_text
    elif quantity is Quantity.TWO_POINT:
        from formulations.bounds.two_point import two_point_bound

        found = two_point_bound(task_dimension, joints, solver=solver, progress=progress)
        plain = found.to_dict()
    elif quantity is Quantity.PLANAR:
        plain = _planar(joints, 2 if locked is None else locked, level, manipulability)
    elif quantity is Quantity.WORST_CASE:
        plain = _worst_case(joints, task_dimension, trace, lever_arm, solver)
        text = without_multipliers
    else:
        plain = _unit_revolute(quantity, joints, preset, rigorous, seed, out)
        text = rounded_outward
    show(plain, as_json, text)
    undecided = plain.get("verdict") == "undecided" or plain.get("proved") is False
    if undecided or plain.get("singular_value_bound", 0) is None:
        raise typer.Exit(UNDECIDED)


def _planar(
    joints: int, locked: int, level: float | None, manipulability: bool
) -> dict[str, Any]:
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
    found = planar_bound(joints, locked, level, measure, progress=progress)
    progress("")
    return found.to_dict()


def _worst_case(
    joints: int, task_dimension: int, trace: float | None, lever_arm: float | None, solver: str
) -> dict[str, Any]:
    from formulations.bounds.worst_case import worst_case_bound

    if lever_arm is None and trace is None and task_dimension == 6:
        lever_arm = 1.0
    if lever_arm is None:
        free = float(task_dimension) if trace is None else trace
        found = worst_case_bound(joints, (task_dimension,), (free,), solver=solver)
    elif task_dimension != 6 or trace is not None:
        allowed = "none with --trace or a --task-dimension other than 6"
        raise InputError("--lever-arm", lever_arm, allowed)
    elif not 1e-100 <= lever_arm <= 1e100:
        raise InputError("--lever-arm", lever_arm, "1e-100 to 1e100")
    else:
        traces = joints * lever_arm**2, float(joints)
        found = worst_case_bound(joints, (3, 3), traces, solver=solver)
    return found if lever_arm != 1.0 else {**found, "sharper": _sharper(joints)}


def _sharper(joints: int) -> list[dict[str, Any]]:
    """Return the bounds on record that are below (6) for revolute joints with |v| ≤ 1.

    Those with lever arms of mean square at most 1 hold for each of at most 1, too.
    """
    from formulations import measures
    from formulations.bounds.certified import best_known
    from formulations.joints.arm import Arm
    from formulations.joints.kinds import LeverRevolute, UnitRevolute
    from formulations.registry import bound as certified_bound

    found: list[dict[str, Any]] = []
    models = {"unit-revolute": UnitRevolute(), "lever-revolute": LeverRevolute()}
    for quantity in ("max-min", "isotropy"):
        for model, joint in models.items():
            one = certified_bound(quantity, Arm.of(joint, joints))
            if one.value >= measures.sigma_bound(6, joints, 2.0 * joints) - 1e-9:
                continue
            best = best_known(quantity, model, joints)
            gap = None if best is None else one.gap_percent(best)
            values = {**one.to_dict(), "best_known": best, "gap_percent": gap}
            found.append({"quantity": quantity, "model": model, **values})
    return found


def _free_levers(quantity: Quantity, joints: int) -> dict[str, Any]:
    from formulations import measures
    from formulations.bounds.certified import best_known
    from formulations.joints.models import arm
    from formulations.registry import bound as certified_bound

    if joints < 7:
        raise InputError("--joints", joints, "at least 7 with --free-levers")
    model = "lever-revolute"
    bound = certified_bound(str(quantity), arm(model, joints))
    best = best_known(str(quantity), model, joints)
    return {
        "quantity": str(quantity),
        "joints": joints,
        "lever_arms": "any" if quantity is Quantity.ISOTROPY else "mean square at most 1",
        "kind": bound.kind,
        "bound": bound.value,
        "best_known": best,
        "gap_percent": None if best is None else measures.gap_percent(best, bound.value),
    }


def _unit_revolute(
    quantity: Quantity,
    joints: int,
    preset: str | None,
    rigorous: bool,
    seed: int,
    out: Path | None,
) -> dict[str, Any]:
    from formulations.joints.arm import Arm
    from formulations.joints.kinds import UnitRevolute
    from formulations.registry import bound

    arm = Arm.of(UnitRevolute(), joints)
    options: dict[str, Any] = {"preset": preset, "seed": seed, "progress": progress, "out": out}
    if rigorous:
        return bound(str(quantity), arm, kind="rigorous", **options).to_dict()
    return bound(str(quantity), arm, kind="relaxation", **options).to_dict()
