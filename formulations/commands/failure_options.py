"""Options that say which joints may fail and how likely, shared by commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.measures.unequal_failures import FailureModel

Probabilities = Annotated[
    str | None,
    typer.Option(
        "--failure-probabilities",
        metavar="P,…",
        help="Each joint's probability of failure, 0 for never; or one number for all.",
        show_default=False,
    ),
]
NeverFails = Annotated[
    str | None,
    typer.Option(
        "--never-fails",
        metavar="JOINT,…",
        help="Joints that never fail, counted from 0.",
        show_default=False,
    ),
]


def failure_model(
    probabilities: str | None, never_fails: str | None, joints: int, locked: int
) -> FailureModel | None:
    """Return the failure model that the two options describe; None if neither is given.

    Raises
    ------
    InputError
        If there is not one probability per joint, or a number is not allowed.
    """
    if probabilities is None and never_fails is None:
        return None
    from formulations.measures.unequal_failures import FailureModel

    never = _whole_numbers(never_fails) if never_fails is not None else []
    if probabilities is None:
        return FailureModel.equally_likely(joints, locked, never)
    values = _numbers(probabilities)
    if len(values) == 1:
        values *= joints
    if len(values) != joints:
        allowed = f"{joints} numbers, one for each joint, or one for all"
        raise InputError("failure probabilities", probabilities, allowed)
    return FailureModel(tuple(values)).sparing(never, locked)


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError("failure probabilities", text, "numbers separated by commas") from None


def _whole_numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        allowed = "joints counted from 0, separated by commas"
        raise InputError("joints that never fail", text, allowed) from None
