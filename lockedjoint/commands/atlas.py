"""``lockedjoint atlas``: the best Jacobians known, beside what is possible at most.

An entry is a file of the package with the best Jacobian known of one kind of arm, its proved
worst case, and how it was found. The work is done in `formulations.atlas`.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import ARGUMENT, group, of_group
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_text, end, fitted, rows_of
from lockedjoint.nlp.errors import InputError

_SECONDS_IN_A_MINUTE = 60.0
# Largest number of characters of the name of who found a Jacobian.
_LONGEST_NAME = 200
# Number of digits of a Jacobian that is shown: enough to copy most of its precision.
_JACOBIAN_DIGITS = 15


def listing(
    where: list[str] | None = None,
    columns: list[str] | None = None,
    entries: Path | None = None,
) -> Answer:
    """List the best worst case known of every kind of arm, beside the sharpest bound.

    Each entry is a Jacobian in a text file. Its worst case is proved from below in rational
    arithmetic from the file's numbers alone. `optimal`: a proved bound is attained;
    `conjectured`: at least 20 starts and a fifth of all end there, which its author reports,
    and nobody verified; `open`: the rest.

    Parameters
    ----------
    where
        By default all entries.
    entries
        Folder of entries, also for the commands below; by default that of the package.
    """
    from lockedjoint.formulations.atlas.collection import read_atlas
    from lockedjoint.formulations.atlas.entry import AtlasRow, row_of
    from lockedjoint.formulations.io.table import Table, chosen_names, chosen_rows

    if columns is not None:
        chosen_names("--columns", columns, Table(AtlasRow, []).columns(every=True))
    chosen_rows(Table(AtlasRow, []), where or ())  # a mistake is better known at once
    table = Table(AtlasRow, list(map(row_of, read_atlas(entries))))
    if where:
        table = Table(AtlasRow, chosen_rows(table, where))
    text = fitted(table, columns) if table.rows else "No such entry."
    return Answer(table.plain(), text)


def show(entry: str) -> Answer:
    """Show all that the atlas has on an entry, its Jacobian and its history included.

    Parameters
    ----------
    entry
        A name that `atlas` lists.
    """
    from lockedjoint.formulations.atlas import collection

    page = collection.atlas(entry, of_group("entries"))
    values = page.facts()
    flat = {k: v for k, v in values.items() if k not in ("jacobian", "found", "history")}
    flat |= {f"found {k}": v for k, v in values["found"].items() if v != ""}
    flat["history"] = [f"{old['value']} ({old['found']['date']})" for old in page.history]
    return Answer(values, f"{as_text(flat)}\n\n{rows_of(values['jacobian'], _JACOBIAN_DIGITS)}")


def verify(
    names: Annotated[list[str] | None, ARGUMENT] = None, bounds: Path | None = None
) -> Answer:
    """Recompute entries from their files alone, with nothing of the solvers.

    Checks that the Jacobian is one of its model, proves its worst case in rational arithmetic,
    compares it with the bound, counts again the directions in which it stays as good, and
    proves that it is a local maximum where the entry says so. Exit status 1 if an entry is
    wrong. How a Jacobian was found is reported by the author of the file, and what rests on
    that alone, such as the mark `conjectured`, is not verified. Exact values, and a few local
    maxima that only they show, are on record: in a clone `python results/atlas/exact.py`
    proves them.

    Parameters
    ----------
    names
        Names that `atlas` lists; by default all entries.
    bounds
        Prove every bound anew, too, with the certificates in this folder, such as
        results/bounds/certificates; takes some four hours of processor time.
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
    entries = of_group("entries")
    pages = [atlas(name, entries) for name in names] if names else read_atlas(entries)
    with LocalExecutor(default_workers()) as executor:
        prover = None if bounds is None else BoundProver(bounds, executor, progress)
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
    right = [page for page in pages if page.entry.name not in problems]
    reported = Counter(page.mark for page in right if "mark" in page.reported)
    for mark, number in reported.items():
        lines.append(f"Marks `{mark}`, reported, not verified: {number}.")
    lines.append(f"Starts, dates and history, reported, not verified: {len(right)}.")
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
        "reported": {"marks": dict(reported), "found": len(right)},
    }
    status = UNSUCCESSFUL if problems else 0
    return Answer(values, "\n".join(lines), status=status)


def export(folder: Path) -> Answer:
    """Write the atlas as a folder to publish, which can be read without a server.

    The folder gets a page, a JSON file and a drawing of the arm for each entry; an index with
    filters; all entries as CSV and as JSON; the schema, CITATION.cff and RO-Crate metadata for
    an archive.

    Parameters
    ----------
    folder
        Folder that is written; created if missing.
    """
    from lockedjoint.figures.manipulator import thumbnail
    from lockedjoint.figures.style import figure_class
    from lockedjoint.formulations.atlas.collection import read_atlas
    from lockedjoint.formulations.atlas.export import MISSING, export
    from lockedjoint.formulations.io.files import prepare_folder

    figure_class()  # a missing package is better known at once
    pages = read_atlas(of_group("entries"))
    files = export(pages, prepare_folder(folder), thumbnail, progress)
    values = {"folder": str(folder), "entries": len(pages), "files": len(files)}
    return Answer({**values, "missing": MISSING})


def submit(
    file: Path,
    entry: str | None = None,
    by: str = "unnamed",
    out_dir: Path | None = None,
) -> Answer:
    """Compare a Jacobian with the atlas: its entry, its proved worst case, and what it gains.

    An improvement by 1e-9 or more is written as an entry that is ready to propose, with the
    value before it in its history.

    Parameters
    ----------
    file
        A Jacobian in CSV, NPY, NPZ or JSON, one column per joint, after # its number in a file
        of several, counted from 0.
    entry
        Name of the entry that it is compared with; by default that of max-min with the
        narrowest model that has such a Jacobian.
    by
        Who or what found it.
    out_dir
        It gets the entry, if that is an improvement.
    """
    from lockedjoint.formulations.atlas import collection
    from lockedjoint.formulations.atlas.entry import RESOLUTION, Found
    from lockedjoint.formulations.io.files import prepare_folder
    from lockedjoint.formulations.io.table import provenance
    from lockedjoint.formulations.measures.read_jacobians import only_jacobian

    if not 0 < len(by) <= _LONGEST_NAME or not by.isprintable():
        raise InputError("--by", by, f"1 to {_LONGEST_NAME} printable characters")
    where = collection.checked_folder(of_group("entries"))
    _, jacobian = only_jacobian(file)
    asked = collection.entry_of(jacobian, 1, entry)
    known = collection.page_of(asked, where)
    if out_dir is not None:
        prepare_folder(out_dir)
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
    if better and out_dir is not None:
        page = collection.improved(asked, jacobian, finding, known)
        values["file"] = str(collection.write_page(page, out_dir))
    return Answer(values)


def improve(
    entry: str,
    time_limit: float = 600.0,
    out_dir: Path = Path("atlas"),
    workers: int | None = None,
    scheduler: str | None = None,
) -> Answer:
    """Search for a better Jacobian of an entry, 20 random starts at a time.

    The entry is written after every 20 starts, and the next run goes on after them. The search
    ends early when 20 starts have reached the best; on a cluster each worker has 20 of its own.

    Parameters
    ----------
    entry
        A name that `atlas` lists.
    time_limit
        Time in seconds after which no further 20 starts begin; it is processor time.
    out_dir
        It gets the entry; the search goes on from what is there.
    """
    from lockedjoint.commands.campaign import dask_executor
    from lockedjoint.formulations.atlas.collection import page_of, write_page
    from lockedjoint.formulations.atlas.entry import entry as entry_named
    from lockedjoint.formulations.atlas.improve import improve as improvements
    from lockedjoint.formulations.io.files import prepare_folder
    from lockedjoint.nlp.executors import default_workers

    asked, count = entry_named(entry), workers or default_workers()
    page = known = page_of(asked, out_dir) or page_of(asked)
    if workers is not None and scheduler is not None:
        raise InputError("--workers", workers, "none with --scheduler")
    with dask_executor(scheduler) if scheduler else nullcontext() as executor:
        pages = improvements(
            asked,
            known,
            time_limit / _SECONDS_IN_A_MINUTE,
            workers=count,
            executor=executor,
            progress=progress,
        )
        prepare_folder(out_dir)
        for page in pages:
            write_page(page, out_dir)
    if page is None:
        end(f"No start led to a Jacobian of the entry {entry}.")
    values = {
        "entry": entry,
        "value": page.value,
        "before": known.value if known else None,
        "starts": page.found.starts,
        "reached_best": page.found.reached_best,
        "mark": page.mark,
        "gap_percent": page.gap_percent,
        "file": str(out_dir / f"{entry}.json") if page is not known else None,
    }
    return Answer(values)


atlas = group("atlas", listing, show, verify, export, submit, improve)
