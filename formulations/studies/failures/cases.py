"""The cases of the study: arms, how many joints lock, which may fail and how likely."""

from __future__ import annotations

from dataclasses import dataclass

from formulations import max_min
from formulations.measures.failure_model import FailureModel
from formulations.solving.setup import Setup
from formulations.unequal_max_min import Goal, default_encoding


@dataclass(frozen=True)
class Case:
    """One row of the study.

    Attributes
    ----------
    setup
        Max-min on a column model.
    joints, task_dimension
        n and m.
    failing
        Which joints may fail, in words.
    """

    setup: Setup
    joints: int
    task_dimension: int
    failing: str = "all alike"


# Model, m, n, k. The planar 4R with two failures is the paper's α = π/4 (after eq. 17).
_SEVERAL = (
    ("free-mean", 2, 4, 2),
    ("free-mean", 2, 5, 2),
    ("free-mean", 2, 5, 3),
    ("free-mean", 3, 5, 2),
    ("free-mean", 3, 6, 2),
    ("free-mean", 3, 6, 3),
    ("unit-revolute", 6, 8, 2),
    ("unit-revolute", 6, 9, 2),
    ("unit-revolute", 6, 9, 3),
    ("unit-revolute", 6, 10, 2),
)
# Three, two and two joints, in the ratio 2 : 4 : 1.
_MIXED = (0.1, 0.1, 0.1, 0.2, 0.2, 0.05, 0.05)


def several() -> tuple[Case, ...]:
    """Cases of k > 1 alike joints."""
    return tuple(
        Case(
            Setup(
                max_min.NAME, model, encoding=encoding, from_residual_minima=minima, locked=k
            ),
            n,
            m,
        )
        for model, m, n, k in _SEVERAL
        for encoding, minima in _ways(model, n - m - k)
    )


def _ways(model: str, spare: int) -> tuple[tuple[str, bool], ...]:
    """Encodings, and whether starts are residual minima, that have a chance on an arm.

    With no column to spare, principal minors lose most starts, and on six rows random starts
    most of what residual minima find.
    """
    if spare > 0:
        return ("shared-factor", False), ("principal-minors", False)
    if model == "unit-revolute":
        return (("shared-factor", True),)
    return (("shared-factor", False),)


def unequal() -> tuple[Case, ...]:
    """Cases of unequal failures, one joint at a time."""
    never = [tuple(range(count)) for count in (1, 2, 3)]
    spared = [
        _unequal("unit-revolute", 6, FailureModel.equally_likely(7, never=some), words)
        for some, words in zip(
            never,
            ("joint 0 never", "joints 0, 1 never", "joints 0, 1, 2 never"),
            strict=True,
        )
    ]
    alike, mixed = FailureModel.equally_likely(7), FailureModel(_MIXED)
    planar = FailureModel((0.1, 0.2, 0.1, 0.1))
    ratios, twice = "in the ratio 2:2:2:4:4:1:1", "joint 1 twice as likely"
    return (
        *spared,
        _unequal("unit-revolute", 6, alike, "all alike", "expected"),
        _unequal("unit-revolute", 6, mixed, ratios),
        _unequal("unit-revolute", 6, mixed, ratios, "expected"),
        _unequal("free", 2, planar, twice),
        _unequal("free", 2, planar, twice, "expected"),
    )


def _unequal(
    model: str, task_dimension: int, failures: FailureModel, words: str, goal: Goal = "worst"
) -> Case:
    setup = Setup(
        max_min.NAME,
        model,
        encoding=default_encoding(failures, goal),
        locked=failures.locked,
        failures=failures,
        goal=goal,
    )
    return Case(setup, failures.joints, task_dimension, words)
