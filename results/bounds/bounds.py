"""The bounds: JSON files as the command prints them, and tables made from them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from formulations.bounds.so3_moments.max_min_bound import max_min_bound
from formulations.bounds.so3_moments.residual_bound import residual_bound
from formulations.bounds.worst_case import worst_case_bound
from formulations.existence.relaxation import existence_relaxation
from formulations.io.pages import outward
from formulations.io.study import Effort, write_json
from formulations.io.table import HIDDEN, column, provenance, versions
from formulations.measures import gap_percent
from results.script import main, study_of

#: The folder of the certificates, within that of the study.
CERTIFICATES = "certificates"
NAN = float("nan")


@dataclass(frozen=True)
class Source:
    """Where a bound came from.

    Attributes
    ----------
    file
        The JSON file that has everything.
    command, versions, machine, date
        What made it, with which packages, on what and when.
    """

    file: str
    command: str = field(metadata=HIDDEN)
    versions: str = field(metadata=HIDDEN)
    machine: str = field(metadata=HIDDEN)
    date: str


@dataclass(frozen=True, kw_only=True)
class BoundRow(Source):
    """The columns of ``bounds.csv``, after the source; NaN where a column does not apply.

    Attributes
    ----------
    quantity, joints, kind, preset
        What is bounded, n, how far it is proved, and the choice of rows.
    bound, closed_form
        The bound, and the value of eq. (6) where it is that.
    best_known, gap_percent
        The best value of the quantity known to be reached, and its distance from the bound in
        percent of the bound.
    moments, largest_block
        Size of the semidefinite program; 0 where there is none on SO(3)ⁿ.
    seconds
        Wall time.
    """

    quantity: str
    joints: int = field(metadata=column("n"))
    kind: str
    preset: str = field(default="", metadata=column(empty="–"))
    bound: float = field(metadata=column(form=lambda row: _shown(row)))
    closed_form: float = field(default=NAN, metadata=column("eq. (6)", ".9g"))
    best_known: float = field(default=NAN, metadata=column("best known", ".9g"))
    gap_percent: float = field(default=NAN, metadata=column("gap %"))
    moments: int = 0
    largest_block: int
    seconds: float = field(metadata=column("wall time (s)", ".1f"))


@dataclass(frozen=True)
class RelaxationRow(Source):
    """The columns of ``relaxations.csv``, after the source: the existence question relaxed.

    Attributes
    ----------
    order, joints
        Order of the relaxation, and n.
    classes, equations, rank, free_moments, largest_block
        Sizes of the semidefinite program; see the columns' headings.
    margin, proved, verdict
        The largest smallest eigenvalue of the blocks, the upper bound of it that the checked
        multipliers prove (NaN without them), and what follows.
    infeasible_alone
        The blocks that are infeasible by themselves.
    seconds
        Wall time.
    """

    order: int
    joints: int = field(metadata=column("n"))
    classes: int = field(metadata=column("classes of monomials"))
    equations: int = field(metadata=column("linear equations"))
    rank: int = field(metadata=column("their rank"))
    free_moments: int
    largest_block: int
    margin: float = field(metadata=column("largest smallest eigenvalue", "+.7f"))
    proved: float = field(metadata=column("proved upper bound of it", "+.7f"))
    verdict: str
    infeasible_alone: str = field(metadata=column(empty="–"))
    seconds: float = field(metadata=column("wall time (s)", ".1f"))


def sharpest(rows: Sequence[BoundRow], quantity: str, kind: str) -> BoundRow | None:
    """Return the sharpest bound of a kind on seven unit revolute joints, if there is one."""
    same = [row for row in rows if (row.quantity, row.kind, row.joints) == (quantity, kind, 7)]
    pick = max if quantity == "residual" else min
    return pick(same, key=lambda row: row.bound, default=None)


def _shown(row: BoundRow) -> str:
    """Return the bound, rounded to the side on which it holds."""
    return outward(row.bound, 9, lower=row.quantity == "residual")


def row_of(plain: Mapping[str, Any], source: Source) -> BoundRow | RelaxationRow:
    """Return the row of a bound's JSON."""
    if "order" in plain:
        return _relaxation_row(plain, source)
    return (_bound_row if "quantity" in plain else _worst_case_row)(plain, source)


@dataclass(frozen=True)
class BoundRun:
    """A bound: the command that prints it, and what computes it.

    The command prints besides what is on record. A rigorous bound writes its certificate to
    the path that it is given.
    """

    command: str
    compute: Callable[[Effort, Path], Mapping[str, Any]]


def _global(quantity: str, preset: str, rigorous: bool = False) -> BoundRun:
    def compute(effort: Effort, certificate: Path) -> Mapping[str, Any]:
        settings: dict[str, Any] = {"rng": effort.seed, "progress": effort.progress}
        if rigorous:
            settings |= {"out": certificate, "rigorous": True}
        bound = max_min_bound if quantity == "max-min" else residual_bound
        return bound(preset, **settings).to_dict()

    command = f"lockedjoint bound {quantity} --preset {preset}"
    return BoundRun(f"{command}{' --rigorous' * rigorous} --json", compute)


#: By the file that they go to.
RUNS: Mapping[str, BoundRun] = MappingProxyType(
    {
        "worst_case_7_6.json": BoundRun(
            "lockedjoint bound worst-case --trace 6 --json",
            lambda *_: worst_case_bound(7, (6,), (6.0,)),
        ),
        "worst_case_7r_lever_arm_1.json": BoundRun(
            "lockedjoint bound worst-case --lever-arm 1 --json",
            lambda *_: worst_case_bound(7, (3, 3), (7.0, 7.0)),
        ),
        **{
            f"existence_order_{order}.json": BoundRun(
                f"lockedjoint bound existence --order {order} --json",
                lambda *_, order=order: existence_relaxation(order, task_dimension=6).to_dict(),
            )
            for order in (2, 3)
        },
        "residual_compact.json": _global("residual", "compact"),
        "residual_tight.json": _global("residual", "tight"),
        "residual_compact_rigorous.json": _global("residual", "compact", rigorous=True),
        "residual_tight_rigorous.json": _global("residual", "tight", rigorous=True),
        "max_min_localised_rigorous.json": _global("max-min", "localised", rigorous=True),
        "max_min_null_vector.json": _global("max-min", "null-vector"),
    }
)


def certificate_of(file: str) -> str:
    """Return the name of the certificate of a rigorous bound's JSON file, in `CERTIFICATES`."""
    return file.replace("_rigorous", "")


def compute(effort: Effort, folder: Path) -> Iterator[BoundRow | RelaxationRow]:
    """Compute the bounds, each into a file of its own."""
    now = provenance()
    used = f"{now['versions']}, {versions(['cvxpy', 'clarabel'])}"
    for file, run in RUNS.items():
        effort.progress(file)
        plain = run.compute(effort, folder / CERTIFICATES / certificate_of(file))
        write_json(folder / file, plain)
        yield row_of(plain, Source(file, run.command, used, now["machine"], now["date"]))


def _bound_row(plain: Mapping[str, Any], source: Source) -> BoundRow:
    size = plain["size"] or {}
    best_known = _number(plain["best_known"])
    return BoundRow(
        **vars(source),
        **_same(plain, "quantity", "joints", "kind", "preset", "bound"),
        best_known=best_known,
        gap_percent=gap_percent(best_known, plain["bound"]),
        moments=size.get("moments", 0),
        largest_block=size.get("largest_block", 0),
        seconds=sum(plain["seconds"].values()),
    )


def _worst_case_row(plain: Mapping[str, Any], source: Source) -> BoundRow:
    arm = "revolute" if plain["facts"] else "free columns"
    return BoundRow(
        **vars(source),
        **_same(plain, "joints", "kind", "seconds"),
        quantity=f"worst case, {arm}, ‖J‖² ≤ {plain['trace']:g}",
        bound=_number(plain["singular_value_bound"]),
        closed_form=_number(plain["closed_form_singular_value_bound"]),
        largest_block=2 * plain["task_dimension"],
    )


def _relaxation_row(plain: Mapping[str, Any], source: Source) -> RelaxationRow:
    alone = [
        f"({','.join(map(str, block['representation']))}) of charge {block['charge']}"
        for block in plain["blocks"]
        if block["infeasible_alone"]
    ]
    sizes = ("order", "joints", "classes", "equations", "rank", "largest_block")
    return RelaxationRow(
        **vars(source),
        **_same(plain, *sizes, "verdict"),
        free_moments=len(plain["free_moments"]),
        margin=_number(plain["margin"]),
        proved=_number((plain["certificate"] or {}).get("proved")),
        infeasible_alone=", ".join(alone),
        seconds=sum(plain["seconds"].values()),
    )


def _same(plain: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: plain[name] for name in names}


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)


STUDY = study_of(
    __file__,
    title="how good any answer could be: eq. (6), the residual, max-min, existence",
    page="README.md",
    tables={"bounds": BoundRow, "relaxations": RelaxationRow},
    takes="half an hour, and 4 GB of memory",
    compute=compute,
    long=True,
    settings={"sharpest": sharpest},
)

if __name__ == "__main__":
    main(STUDY, __file__)
