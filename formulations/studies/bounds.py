"""The bounds as a study: JSON files as the command prints them, and tables made from them."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from formulations.bounds.so3_moments.global_bound import GlobalBound
from formulations.bounds.so3_moments.max_min_bound import max_min_bound
from formulations.bounds.so3_moments.residual_bound import residual_bound
from formulations.bounds.worst_case import worst_case_bound
from formulations.existence.relaxation import existence_relaxation
from formulations.io.provenance import provenance, versions
from formulations.io.table import HIDDEN, column
from formulations.measures import gap_percent
from formulations.studies.pages import outward
from formulations.studies.study import INCOMPLETE, Effort, Part, Study

#: The folder of the certificates, within that of the study.
CERTIFICATES = "certificates"
NAN = float("nan")
_UNKNOWN = "not recorded"


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


def study() -> Study:
    """Return the study of bounds."""
    return Study(
        name="bounds",
        title="how good any answer could be: eq. (6), the residual, max-min, existence",
        page="README.md",
        template="bounds.md.j2",
        tables={"bounds": BoundRow, "relaxations": RelaxationRow},
        command="lockedjoint report --only bounds --out results",
        takes="half an hour, and 4 GB of memory",
        compute=_compute,
        long=True,
        settings={"sharpest": sharpest},
    )


def sharpest(rows: Sequence[BoundRow], quantity: str, kind: str) -> BoundRow | None:
    """Return the sharpest bound of a kind on seven unit revolute joints, if there is one."""
    found = [row for row in rows if (row.quantity, row.kind, row.joints) == (quantity, kind, 7)]
    pick = max if quantity == "residual" else min
    return pick(found, key=lambda row: row.bound) if found else None


def _shown(row: BoundRow) -> str:
    """Return the bound, rounded to the side on which it holds."""
    return outward(row.bound, 9, lower=row.quantity == "residual")


def row_of(plain: Mapping[str, Any], source: Source) -> BoundRow | RelaxationRow:
    """Return the row of a bound's JSON."""
    if "order" in plain:
        return _relaxation_row(plain, source)
    return (_bound_row if "quantity" in plain else _worst_case_row)(plain, source)


def command(plain: Mapping[str, Any]) -> str:
    """Return what printed a bound's JSON, with the default seed and solver."""
    words = ["lockedjoint bound"]
    if "order" in plain:
        words.append(f"existence --order {plain['order']}")
    elif "quantity" in plain:
        words.append(f"{plain['quantity']} --preset {plain['preset']}")
    elif plain["facts"]:
        words.append(
            f"worst-case --lever-arm {(plain['trace'] / plain['joints'] - 1) ** 0.5:g}"
        )
    else:
        words.append(f"worst-case --trace {plain['trace']:g}")
    if plain["joints"] != 7:
        words.append(f"--joints {plain['joints']}")
    if plain["kind"] == "rigorous":
        words.append("--rigorous")
    return " ".join([*words, "--json"])


def _numerical(
    bound: Callable[..., GlobalBound], preset: str, effort: Effort, _: Path
) -> Mapping[str, Any]:
    return bound(preset, rng=effort.seed, progress=effort.progress).to_dict()


def _rigorous(
    bound: Callable[..., GlobalBound], preset: str, effort: Effort, certificate: Path
) -> Mapping[str, Any]:
    settings = {"rng": effort.seed, "progress": effort.progress}
    return bound(preset, out=certificate, **settings).to_dict()


#: What the study computes, as ``lockedjoint bound … --json`` prints it (without what is on
#: record), by the file it goes to. A rigorous run writes its certificate to the path.
RUNS: Mapping[str, Callable[[Effort, Path], Mapping[str, Any]]] = MappingProxyType(
    {
        "worst_case_7_6.json": lambda *_: worst_case_bound(7, (6,), (6.0,)),
        "worst_case_7r_lever_arm_1.json": lambda *_: worst_case_bound(7, (3, 3), (7.0, 7.0)),
        "existence_order_2.json": lambda *_: existence_relaxation(
            2, task_dimension=6
        ).to_dict(),
        "existence_order_3.json": lambda *_: existence_relaxation(
            3, task_dimension=6
        ).to_dict(),
        "residual_compact.json": partial(_numerical, residual_bound, "compact"),
        "residual_tight.json": partial(_numerical, residual_bound, "tight"),
        "residual_compact_rigorous.json": partial(
            _rigorous, partial(residual_bound, rigorous=True), "compact"
        ),
        "residual_tight_rigorous.json": partial(
            _rigorous, partial(residual_bound, rigorous=True), "tight"
        ),
        "max_min_localised_rigorous.json": partial(
            _rigorous, partial(max_min_bound, rigorous=True), "localised"
        ),
        "max_min_null_vector.json": partial(_numerical, max_min_bound, "null-vector"),
    }
)


def certificate_of(file: str) -> str:
    """Return the name of the certificate of a rigorous bound's JSON file, in `CERTIFICATES`."""
    return file.replace("_rigorous", "")


def _compute(effort: Effort, folder: Path) -> Iterator[Part]:
    """Compute the runs, then list the files of the folder that others made."""
    names = [one.name for one in fields(Source)]
    before = {
        row.file: Source(*(getattr(row, name) for name in names))
        for rows in study().read(folder).values()
        for row in rows
    }
    for file, run in RUNS.items():
        effort.progress(file)
        plain = run(effort, folder / INCOMPLETE / CERTIFICATES / certificate_of(file))
        text = json.dumps(plain, indent=1) + "\n"
        yield Part(rows=[row_of(plain, _here(file, plain))], files={file: text.encode()})
    for path in sorted(folder.glob("*.json")):
        if path.name not in RUNS:
            plain = json.loads(path.read_text(encoding="utf-8"))
            unknown = Source(path.name, command(plain), _UNKNOWN, _UNKNOWN, _UNKNOWN)
            yield Part(rows=[row_of(plain, before.get(path.name, unknown))])


def _here(file: str, plain: Mapping[str, Any]) -> Source:
    now = provenance()
    used = f"{now['versions']}, {versions(['cvxpy', 'clarabel'])}"
    return Source(file, command(plain), used, now["machine"], now["date"])


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
