"""``lockedjoint atlas``: the best Jacobians known, beside what is possible at most."""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import argument, flag, option, register
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_text, end, progress, rows_of
from lockedjoint.nlp.errors import InputError

app = typer.Typer(name="atlas", rich_markup_mode=None)

Folder = Annotated[
    Path | None,
    option("DIR", "Folder of entries; by default that of the package.", ..., "--entries"),
]
Name = Annotated[str, argument("ENTRY", "A name that `atlas` lists.")]
Names = Annotated[list[str] | None, argument("[ENTRY]...", "Names; by default all entries.")]


@app.callback(invoke_without_command=True)
def atlas(
    context: typer.Context,
    model: str | None = option("NAME", "Only this column model."),
    joints: int | None = option("N", "Only this number of joints n.", low=2),
    task_dimension: int | None = option("M", "Only this number of task dimensions m.", low=1),
    locked: int | None = option("K", "Only this number of joints that lock at once.", low=1),
    mark: Literal["optimal", "conjectured", "open"] | None = option(None, "Only this mark."),
    entries: Folder = None,
    as_json: cli.Json = False,
) -> None:
    """List the best worst case known of every kind of arm, beside the sharpest bound.

    Each entry is a Jacobian in a text file. Its worst case is proved from below in rational
    arithmetic from the file's numbers alone. `optimal`: a proved bound is attained;
    `conjectured`: at least 20 starts and a fifth of all end there; `open`: the rest.
    """
    if context.invoked_subcommand is not None:
        for name, value in context.params.items():  # it would not be heeded
            if value not in (None, False):
                option_name = f"--{name.removeprefix('as_').replace('_', '-')}"
                raise InputError(option_name, value, f"after `{context.invoked_subcommand}`")
        return
    from lockedjoint.formulations.atlas.collection import read_atlas
    from lockedjoint.formulations.atlas.entry import AtlasRow, row_of
    from lockedjoint.formulations.atlas.entry import entries as known_entries
    from lockedjoint.formulations.io.table import Table

    models = list(dict.fromkeys(entry.model for entry in known_entries().values()))
    if model is not None and model not in models:
        plain = [name for name in models if ":" not in name]
        allowed = f"{', '.join(plain)} or a mix such as {models[len(plain)]}"
        raise InputError("--model", model, allowed)
    wanted = {
        "model": model,
        "joints": joints,
        "task_dimension": task_dimension,
        "locked": locked,
        "mark": mark,
    }
    rows = [
        row
        for row in map(row_of, read_atlas(entries))
        if all(value in (None, getattr(row, name)) for name, value in wanted.items())
    ]
    table = Table(AtlasRow, rows)
    Answer(table.plain(), table.terminal() if rows else "No such entry.").show(as_json)


@register(app)
def show(name: Name, entries: Folder = None) -> Answer:
    """Show all that the atlas has on an entry, its Jacobian and its history included."""
    from lockedjoint.formulations.atlas import collection

    page = collection.atlas(name, entries)
    values = page.facts()
    flat = {k: v for k, v in values.items() if k not in ("jacobian", "found", "history")}
    flat |= {f"found {k}": v for k, v in values["found"].items() if v != ""}
    flat["history"] = [f"{old['value']} ({old['found']['date']})" for old in page.history]
    return Answer(values, f"{as_text(flat)}\n\n{rows_of(values['jacobian'], 15)}")


@register(app)
def verify(
    names: Names = None,
    entries: Folder = None,
    bounds: bool = flag("--bounds", "Also prove every bound anew; takes minutes."),
    certificates: Path = option(
        "DIR",
        "With --bounds: the folder of the certificates of the residual and of max-min.",
        Path("results/bounds/certificates"),
    ),
    workers: cli.Workers = None,
) -> Answer:
    """Recompute entries from their files alone, with nothing of the solvers.

    Checks that the Jacobian is one of its model, proves its worst case in rational arithmetic,
    compares it with the bound, counts again the directions in which it stays as good, and
    proves that it is a local maximum where the entry says so. Exit status 1 if an entry is
    wrong. Exact values, and a few local maxima that only they show, are on record: in a clone
    `python results/atlas/exact.py` proves them.
    """
    from lockedjoint.formulations.atlas.collection import (
        atlas,
        maximum_is_on_record,
        read_atlas,
        wrong_entries,
    )
    from lockedjoint.formulations.atlas.proved_bounds import BoundProver
    from lockedjoint.formulations.existence.certificate import CertificateError
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    kinds, exact, maxima = Counter[str](), Counter[str](), Counter[str]()
    pages = [atlas(name, entries) for name in names] if names else read_atlas(entries)
    with LocalExecutor(workers or default_workers()) as executor:
        prover = BoundProver(certificates, executor, progress) if bounds else None
        problems = wrong_entries(pages, executor, progress)
        for page in pages:
            name, bound = page.entry.name, page.entry.bound
            if prover and name not in problems:
                progress(f"bound of {name}")
                try:
                    prover.prove(page, bound)
                    kinds[bound.kind] += 1
                except CertificateError as error:
                    problems[name] = str(error).rstrip(".")
            if name not in problems:
                if page.exact:
                    exact[page.exact.known] += 1
                if page.locally_optimal:
                    maxima["on record" if maximum_is_on_record(page) else "proved"] += 1
    count = len(pages)
    lines = [f"{name}: {problem}." for name, problem in problems.items()]
    for kind, number in kinds.items():
        known = "not proved" if kind.startswith("numerical") else "proved"
        lines.append(f"Bounds {known}, {kind}: {number}.")
    lines += [f"Local maxima {known}: {number}." for known, number in maxima.items()]
    lines += [f"Exact values on record, {known}: {number}." for known, number in exact.items()]
    if exact:
        script = "`python results/atlas/exact.py` in a clone"
        lines.append(f"What is on record is proved by {script}, not here.")
    lines.append(f"{count - len(problems)} of {count} entries are right.")
    values = {
        "entries": count,
        "wrong": problems,
        "bounds": dict(kinds),
        "local_maxima": dict(maxima),
        "exact_on_record": dict(exact),
    }
    status = UNSUCCESSFUL if problems else 0
    return Answer(values, "\n".join(lines), status=status)


@register(app)
def export(
    folder: Annotated[Path, argument("DIR", "Folder that is written; created if missing.")],
    entries: Folder = None,
) -> Answer:
    """Write the atlas as a folder to publish, which can be read without a server.

    Of each entry a page, a JSON file and a drawing of its arm; an index with filters; all
    entries as CSV and as JSON; the schema, CITATION.cff and RO-Crate metadata for an archive.
    """
    from lockedjoint.figures.manipulator import thumbnail
    from lockedjoint.figures.style import figure_class
    from lockedjoint.formulations.atlas.collection import read_atlas
    from lockedjoint.formulations.atlas.export import MISSING, export
    from lockedjoint.formulations.io.files import prepare_folder

    figure_class()  # a missing package is better known at once
    pages = read_atlas(entries)
    files = export(pages, prepare_folder(folder), thumbnail, progress)
    values = {"folder": str(folder), "entries": len(pages), "files": len(files)}
    return Answer({**values, "missing": MISSING})


@register(app)
def submit(
    file: cli.JacobianFile,
    locked: int | None = option("K", "How many joints lock at once; by default one.", low=1),
    entry: str | None = option(
        "ENTRY", "By default max-min's with the narrowest model that the Jacobian is of."
    ),
    by: str = option("NAME", "Who or what found it.", "unnamed"),
    out: Path | None = option("DIR", "Write the entry there if it is an improvement."),
    pick: cli.Pick = None,
    entries: Folder = None,
) -> Answer:
    """Compare a Jacobian with the atlas: its entry, its proved worst case, and what it gains.

    An improvement by 1e-9 or more is written as an entry that is ready to propose, with the
    value before it in its history.
    """
    from lockedjoint.formulations.atlas import collection
    from lockedjoint.formulations.atlas.entry import RESOLUTION, Found
    from lockedjoint.formulations.io.files import prepare_folder
    from lockedjoint.formulations.io.table import provenance
    from lockedjoint.formulations.measures.read_jacobians import only_jacobian

    if not 0 < len(by) <= 200 or not by.isprintable():
        raise InputError("--by", by, "1 to 200 printable characters")
    where = collection.checked_folder(entries)
    _, jacobian = only_jacobian(file, pick)
    if entry and locked:
        raise InputError("--locked", locked, "none with --entry, whose name says it")
    asked = collection.entry_of(jacobian, locked or 1, entry)
    known = collection.page_of(asked, where)
    if out is not None:
        prepare_folder(out)
    finding = Found(by, provenance()["date"], versions=provenance()["versions"])
    new = collection.improved(asked, jacobian, finding, None)
    gain = float(new.value) - float(known.value) if known else None
    better = gain is None or gain >= RESOLUTION
    values: dict[str, Any] = {
        "entry": asked.name,
        "value": new.value,
        "best_known": known.value if known else None,
        "gain": gain,
        "improvement": better,
        "bound": asked.bound.to_dict(),
    }
    if better and out is not None:
        page = collection.improved(asked, jacobian, finding, known)
        values["file"] = str(collection.write_page(page, out))
    return Answer(values)


@register(app)
def improve(
    name: Name,
    minutes: float = option(
        "MINUTES", "Processor time after which no further 20 starts begin.", 10.0, positive=True
    ),
    out: Path = option("DIR", "Folder of the entry; it goes on from there.", Path("atlas")),
    workers: cli.Workers = None,
    scheduler: cli.Scheduler = None,
) -> Answer:
    """Search for a better Jacobian of an entry, 20 random starts at a time.

    The entry is written after every 20 starts, and the next run goes on after them. The search
    ends early when 20 starts have reached the best; on a cluster each worker has 20 of its own.
    """
    from lockedjoint.commands.campaign import dask_executor
    from lockedjoint.formulations.atlas.collection import page_of, write_page
    from lockedjoint.formulations.atlas.entry import entry
    from lockedjoint.formulations.atlas.improve import improve as improvements
    from lockedjoint.formulations.io.files import prepare_folder
    from lockedjoint.nlp.executors import default_workers

    asked, count = entry(name), workers or default_workers()
    page = known = page_of(asked, out) or page_of(asked)
    if workers is not None and scheduler is not None:
        raise InputError("--workers", workers, "none with --scheduler")
    with dask_executor(scheduler) if scheduler else nullcontext() as executor:
        pages = improvements(
            asked, known, minutes, workers=count, executor=executor, progress=progress
        )
        prepare_folder(out)
        for page in pages:
            write_page(page, out)
    if page is None:
        end(f"No start led to a Jacobian of the entry {name}.")
    values = {
        "entry": name,
        "value": page.value,
        "before": known.value if known else None,
        "starts": page.found.starts,
        "reached_best": page.found.reached_best,
        "mark": page.mark,
        "gap_percent": page.gap_percent,
        "file": str(out / f"{name}.json") if page is not known else None,
    }
    return Answer(values)
