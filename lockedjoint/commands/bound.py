"""``lockedjoint bound``: how good any answer could be, a command for each quantity.

Letters: m task dimensions, n joints, J the Jacobian, m × n. A bound is from above for the worst
case, and from below for the residual; what is shown is rounded so that it still holds.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import ARGUMENT, group
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_table, as_text
from lockedjoint.commands.shared import Failures
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.formulations.joints.arm import Arm


# Default level of `planar`, in units of the best value known: closer to it takes much longer.
_MORE_THAN_KNOWN = 1.001
# Number of digits of a bound that is shown.
_DIGITS = 9


def record(joints: Annotated[int, ARGUMENT] = 7, columns: list[str] | None = None) -> Answer:
    """List the bounds on record for revolute joints, and the best scores known.

    The joints are unit-revolute ones, whose lever arms |v| are 1, and lever-revolute ones,
    whose lever arms have a mean square of at most 1. Isotropic arms may have lever arms of any
    length.

    Parameters
    ----------
    joints
        By default 7.
    """
    from lockedjoint.formulations.bounds.certified import best_known
    from lockedjoint.formulations.joints.models import arm
    from lockedjoint.formulations.registry import bound as proved_bound

    rows, models = [], ("unit-revolute", "lever-revolute")
    for quantity, model in product(("residual", "max-min", "isotropy"), models):
        limit = proved_bound(quantity, arm(model, joints))
        best = best_known(quantity, model, joints)
        row = {"quantity": quantity, "model": model, "bound": limit.to_dict()["value"]}
        gap = None if best is None else limit.gap_percent(best)
        rows.append(row | {"kind": limit.kind, "best_known": best, "gap_percent": gap})
    gaps = "The gap is 100·|bound − best known|/bound."
    table = as_table(list(map(_rounded_outward, rows)), columns=columns)
    return Answer(rows, f"{table}\n\n{gaps}")


def worst_case(
    failing: Failures,
    joints: Annotated[int, ARGUMENT] = 7,
    task_dimension: int = 6,
    model: str | None = None,
    trace: float | None = None,
    lever_arm: float | None = None,
    solver: str = "CLARABEL",
) -> Answer:
    """Bound the worst case after failures by a semidefinite program in cvxpy.

    The solver's value is numerical. Its multipliers become fractions, and what these prove is
    the bound. Beside it: equation (6), and the sharpest bound known, by whatever proof.

    Parameters
    ----------
    joints
        By default 7.
    model
        By default --lever-arm. docs/howto/bound_an_arm.md has examples.
    trace
        Largest ‖J‖_F² of the Jacobians that are bounded; by default m, unless m = 6.
    lever_arm
        Largest |v| of the revolute joints that are bounded; by default 1 if m = 6.
    solver
        Name of the solver: one that solves semidefinite programs in cvxpy.
    """
    from lockedjoint.formulations.bounds import certified
    from lockedjoint.formulations.bounds.relaxed import TooLargeError, relaxed
    from lockedjoint.formulations.measures import sigma_bound

    arm = _arm(joints, task_dimension, model, trace, lever_arm)
    m, n = arm.shape
    unequal = failing.model([""] * n)
    known = (
        certified.largest_worst_case(arm, failing.failures)
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
        plain["equation_6"] = sigma_bound(m, n, arm.largest_trace, failing.failures)
    try:
        found = relaxed(arm, unequal or failing.failures, solver=solver).to_dict()
    except TooLargeError as error:
        found = {"bound": None, "status": str(error)}
    plain |= {"relaxation": found.pop("bound")} | found
    return Answer(plain, lambda plain: as_text(_rounded_up(plain)))


def _rounded_up(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with bounds that hold as they are shown."""
    from lockedjoint.formulations.io.rounding import outward

    bounds = ("sharpest", "equation_6", "relaxation")
    shown = {
        name: outward(plain[name], _DIGITS, lower=False)
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


def two_point(joints: Annotated[int, ARGUMENT] = 7, task_dimension: int = 6) -> Answer:
    """Bound the worst case after two failures at once, of columns with ‖J‖_F² = n.

    It follows from conditions on pairs of columns. n must be at least m + 2.

    Parameters
    ----------
    joints
        By default 7.
    """
    from lockedjoint.formulations.bounds.two_point import two_point_bound

    return Answer(two_point_bound(task_dimension, joints, progress=progress).to_dict())


def planar(
    joints: Annotated[int, ARGUMENT] = 7,
    failures: int = 2,
    level: float | None = None,
    measure: Literal["max-min", "manipulability", "condition"] = "max-min",
) -> Answer:
    """Prove that no Jacobian of two rows is better than --level, by branch and bound.

    Parameters
    ----------
    joints
        By default 7.
    level
        The value that no Jacobian with ‖J‖_F² = n is to reach; by default 0.1 % more than the
        atlas has.
    measure
        What is bounded: max-min, the worst case; manipulability, the least that a failure
        leaves of it, relative to the whole; or condition, the least ratio of the smallest to
        the largest singular value.
    """
    from lockedjoint.formulations.atlas.collection import page_of
    from lockedjoint.formulations.atlas.entry import Entry
    from lockedjoint.formulations.bounds.planar import planar_bound

    if level is None:
        page = page_of(Entry("free-mean", 2, joints, failures, measure))
        if page is None:
            allowed = "a number: the atlas has no Jacobian of this size"
            raise InputError("--level", "none", allowed)
        level = _MORE_THAN_KNOWN * float(page.value)
    plain = planar_bound(joints, failures, level, measure, progress=progress).to_dict()
    return Answer(plain, status=0 if plain["proved"] else UNSUCCESSFUL)


def residual(
    joints: Annotated[int, ARGUMENT] = 7,
    out: Path | None = None,
    seed: int = 0,
    solver: str = "predictor-corrector",
) -> Answer:
    """Prove a bound on the residual ½‖JJᵀ − (n/3)I‖² of unit revolute joints, globally.

    A certificate is written and verified from its file, all rounding errors bounded: minutes.

    Parameters
    ----------
    joints
        They are unit revolute joints, 6 to 9; by default 7.
    out
        The file that is written: the certificate, for `lockedjoint verify`.
    solver
        Name of the solver: predictor-corrector is our dense method; one in cvxpy, such as
        clarabel, takes ten times as long.
    """
    from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import residual_bound

    return _proved(partial(residual_bound, joints), out, seed, solver=solver)


def max_min(
    out: Path | None = None, seed: int = 0, solver: str = "predictor-corrector"
) -> Answer:
    """Prove a bound on the worst case of seven unit revolute joints, globally.

    A certificate is written and verified from its file, as for the residual. It takes minutes
    and 4 GB. For another arm: `lockedjoint bound worst-case --model …`.

    Parameters
    ----------
    out
        The file that is written: the certificate, for `lockedjoint verify`.
    solver
        Name of the solver: predictor-corrector is our dense method; one in cvxpy, such as
        clarabel, takes ten times as long.
    """
    from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import max_min_bound

    return _proved(max_min_bound, out, seed, solver=solver)


def isotropy(out: Path | None = None, seed: int = 0) -> Answer:
    """Prove a bound on the worst case of seven isotropic revolute joints, of any lever arms.

    A certificate is written and verified from its file, as for the residual.

    Parameters
    ----------
    out
        The file that is written: the certificate, for `lockedjoint verify`.
    """
    from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import isotropy_bound

    return _proved(isotropy_bound, out, seed)


def _proved(
    compute: Callable[..., dict[str, Any]], out: Path | None, seed: int, **others: str
) -> Answer:
    """Call a function that proves a bound and writes its certificate; return the answer."""
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    with LocalExecutor(default_workers()) as executor:
        plain = compute(seed=seed, progress=progress, out=out, executor=executor, **others)
    return Answer(plain, lambda plain: as_text(_rounded_outward(plain)))


def _rounded_outward(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with a bound that holds as it is shown."""
    from lockedjoint.formulations.io.rounding import outward

    limit, lower = plain["bound"], plain["quantity"] == "residual"
    return {
        **plain,
        "bound": "none exists" if limit is None else outward(limit, _DIGITS, lower=lower),
    }


def of_seven_joints() -> Answer:
    """Bound how good any answer could be.

    Without a command it shows the bound (6) on the worst case of seven revolute joints with |v|
    at most 1, and the sharper bounds on record. All of these are proved. The exact proof that
    no optimally failure-tolerant 7R Jacobian exists is `lockedjoint prove`.
    """
    first, known = worst_case(Failures()), record()
    text = f"{as_text(first.values)}\n\n{known.text}"
    return Answer({"worst_case": first.values, "record": known.values}, text)


bound = group(
    "bound",
    of_seven_joints,
    record,
    worst_case,
    two_point,
    planar,
    residual,
    max_min,
    isotropy,
)
