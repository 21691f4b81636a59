"""The bounds as rows of tables, made from the JSON that `lockedjoint bound` prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

NAN = float("nan")


@dataclass(frozen=True)
class Origin:
    """Where a bound came from: what made it, with what, on what and when."""

    command: str
    versions: str
    machine: str
    date: str


@dataclass(frozen=True)
class BoundRow:
    """The columns of ``bounds.csv``; NaN where a column does not apply.

    Attributes
    ----------
    file
        The JSON file that has everything.
    quantity, joints, kind, preset
        What is bounded, n, how far it is proved, and the choice of rows.
    bound, closed_form
        The bound, and the value of eq. (6) where it is that.
    best_known, gap_percent
        The best value of the quantity known to be reached, and its distance in percent of it.
    moments, largest_block
        Size of the semidefinite program; 0 where there is none on SO(3)ⁿ.
    seconds
        Wall time.
    command, versions, machine, date
        See `Origin`.
    """

    file: str
    quantity: str
    joints: int
    kind: str
    preset: str
    bound: float
    closed_form: float
    best_known: float
    gap_percent: float
    moments: int
    largest_block: int
    seconds: float
    command: str
    versions: str
    machine: str
    date: str


@dataclass(frozen=True)
class ExistenceRow:
    """The columns of ``relaxations.csv``: the moment relaxation of the existence question.

    Attributes
    ----------
    file
        The JSON file that has everything.
    order, joints
        Of the relaxation; n.
    classes, equations, rank, free_moments, largest_block
        Its size.
    margin, proved
        Largest possible smallest eigenvalue, and what the multipliers prove of it.
    verdict, infeasible_alone
        What follows, and the blocks that are infeasible by themselves.
    seconds
        Wall time.
    command, versions, machine, date
        See `Origin`.
    """

    file: str
    order: int
    joints: int
    classes: int
    equations: int
    rank: int
    free_moments: int
    largest_block: int
    margin: float
    proved: float
    verdict: str
    infeasible_alone: str
    seconds: float
    command: str
    versions: str
    machine: str
    date: str


def is_relaxation(plain: Mapping[str, Any]) -> bool:
    """Whether a bound's JSON is of the existence question."""
    return "order" in plain


def command(plain: Mapping[str, Any]) -> str:
    """Return what printed a bound's JSON, with a default seed and solver."""
    words = ["lockedjoint bound"]
    if is_relaxation(plain):
        words.append(f"--quantity existence --order {plain['order']}")
    elif "quantity" in plain:
        words.append(f"--quantity {plain['quantity']} --preset {plain['preset']}")
    elif plain["facts"]:
        words.append(f"--lever-arm {(plain['trace'] / plain['joints'] - 1) ** 0.5:g}")
    if plain["joints"] != 7:
        words.append(f"--joints {plain['joints']}")
    if plain["kind"] == "rigorous":
        words.append("--rigorous")
    return " ".join([*words, "--json"])


def bound_row(file: str, plain: Mapping[str, Any], origin: Origin) -> BoundRow:
    """Return the row of a bound on a value."""
    if "quantity" not in plain:
        return _worst_case_row(file, plain, origin)
    size = plain["size"] or {}
    return BoundRow(
        file=file,
        quantity=plain["quantity"],
        joints=plain["joints"],
        kind=plain["kind"],
        preset=plain["preset"],
        bound=plain["bound"],
        closed_form=NAN,
        best_known=_number(plain["best_known"]),
        gap_percent=_number(plain["gap_percent"]),
        moments=size.get("moments", 0),
        largest_block=size.get("largest_block", 0),
        seconds=sum(plain["seconds"].values()),
        **vars(origin),
    )


def _worst_case_row(file: str, plain: Mapping[str, Any], origin: Origin) -> BoundRow:
    arm = "revolute" if plain["facts"] else "free columns"
    return BoundRow(
        file=file,
        quantity=f"worst case, {arm}, ‖J‖² ≤ {plain['trace']:g}",
        joints=plain["joints"],
        kind=plain["kind"],
        preset="",
        bound=_number(plain["singular_value_bound"]),
        closed_form=_number(plain["closed_form_singular_value_bound"]),
        best_known=NAN,
        gap_percent=NAN,
        moments=0,
        largest_block=2 * plain["task_dimension"],
        seconds=plain["seconds"],
        **vars(origin),
    )


def existence_row(file: str, plain: Mapping[str, Any], origin: Origin) -> ExistenceRow:
    """Return the row of a relaxation of the existence question."""
    alone = [block for block in plain["blocks"] if block["infeasible_alone"]]
    return ExistenceRow(
        file=file,
        order=plain["order"],
        joints=plain["joints"],
        classes=plain["classes"],
        equations=plain["equations"],
        rank=plain["rank"],
        free_moments=len(plain["free_moments"]),
        largest_block=plain["largest_block"],
        margin=_number(plain["margin"]),
        proved=_number((plain["certificate"] or {}).get("proved")),
        verdict=plain["verdict"],
        infeasible_alone=", ".join(_shape(block) for block in alone),
        seconds=sum(plain["seconds"].values()),
        **vars(origin),
    )


def _shape(block: Mapping[str, Any]) -> str:
    shape = ",".join(str(part) for part in block["representation"])
    return f"({shape}) of charge {block['charge']}"


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)
