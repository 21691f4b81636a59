"""The atlas as a folder to publish: pages, data and metadata that need no server.

For each entry the folder has a page (HTML), its facts (JSON, `EntryPage.facts`) and, where
there is an arm to draw, a drawing (SVG). For all entries it has an index, a table (CSV,
`AtlasRow`), the facts (JSON) and their schema, a licence, and metadata: CITATION.cff and an
RO-Crate. The templates are in the folder ``site`` beside this file.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from mimetypes import MimeTypes
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from lockedjoint.formulations import condition, manipulability, measures
from lockedjoint.formulations.atlas.collection import folder
from lockedjoint.formulations.atlas.entry import AtlasRow, EntryPage, row_of
from lockedjoint.formulations.bounds.certified import FIVE_LEVERS, LEVER_CELLS
from lockedjoint.formulations.io.files import write_bytes
from lockedjoint.formulations.io.table import Table
from lockedjoint.formulations.measures.canonical import count_symmetries
from lockedjoint.formulations.measures.worst_failure import TIE
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Step

#: What an archive asks for and only the owner of the atlas can state.
MISSING = ("the DOI", "authors by name with their ORCID", "the address of the publication")
_SITE = Path(__file__).parent / "site"
#: File that says, by entry, what twenty random starts found: a list of two numbers, that of
#: inequivalent optima and that of starts that reached the best.
INEQUIVALENT = _SITE / "inequivalent.json"
# Largest number of sets of locked joints that a page lists, the worst first.
_MOST_SETS = 24
# Number of rows of a spatial Jacobian.
_SPATIAL_ROWS = 6
# Columns of the index by which a reader can filter: field of `AtlasRow`, and label on the page.
_FILTERS = {
    "model": "model",
    "task_dimension": "m",
    "joints": "n",
    "failures": "k",
    "formulation": "problem",
    "mark": "mark",
}
# These values are listed on a page for each set of locked joints, by formulation; else σ is.
_MEASURES = {
    manipulability.NAME: measures.relative_manipulability,
    condition.NAME: measures.reciprocal_conditions,
}
_CERTIFICATES = "the certificate results/bounds/certificates/"
#: How a bound can be known, and from what, besides the entry, it is proved again.
EVIDENCE = {
    "closed form": "",
    "proved (relaxation)": "",
    "proved (branch and bound)": "the record formulations/bounds/planar.json and ",
    FIVE_LEVERS: "",
    "proved (two-point)": "the multipliers in formulations/bounds/two_point.json and ",
    "proved (tight)": f"{_CERTIFICATES}residual_tight.json and ",
    "proved (null-vector)": f"{_CERTIFICATES}max_min_null_vector.json and ",
    LEVER_CELLS: f"{_CERTIFICATES}isotropic_levers.json and ",
}


def export(
    pages: Sequence[EntryPage],
    where: Path,
    drawing: Callable[[FloatArray], bytes],
    progress: Callable[[str], None] = lambda _: None,
) -> list[str]:
    """Write the atlas into a folder, which is there, and return the names of the files.

    `drawing` returns the SVG of the arm of a Jacobian, shape (m, n). `progress` is told which
    entry is written.
    """
    written = {}
    for name, content in _files(pages, drawing, progress):
        write_bytes(where / name, content)
        written[name] = len(content)
    crate = _text(_crate(written, max(page.found.date for page in pages)))
    write_bytes(where / "ro-crate-metadata.json", crate)
    return [*written, "ro-crate-metadata.json"]


def _files(
    pages: Sequence[EntryPage],
    drawing: Callable[[FloatArray], bytes],
    progress: Callable[[str], None],
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of each file but the metadata."""
    for number, page in enumerate(pages):
        progress(Step(page.entry.name, number / len(pages)))
        drawn = _is_drawn(page)
        if drawn:
            yield f"{page.entry.name}.svg", drawing(page.jacobian)
        yield f"{page.entry.name}.json", _text({"$schema": "schema.json", **page.facts()})
        yield f"{page.entry.name}.html", _page(page, drawn).encode()
    rows = [row_of(page) for page in pages]
    index = _filled("index.html.j2", {"rows": rows, "filters": _FILTERS.items()})
    yield "index.html", index.encode()
    yield "atlas.csv", Table(AtlasRow, rows).csv().encode()
    yield "atlas.json", _text([page.facts() for page in pages])
    yield "schema.json", (_SITE / "schema.json").read_bytes()
    yield "LICENSE", (folder() / "LICENSE").read_bytes()
    date = max(page.found.date for page in pages)
    about = {"version": version("lockedjoint"), "date": date, "missing": MISSING}
    yield "CITATION.cff", _filled("CITATION.cff.j2", about).encode()


def _is_drawn(page: EntryPage) -> bool:
    """Whether there is an arm to draw: every column is that of a joint.

    Free columns of two or three rows are those of joints in the plane and in space. With six
    rows they are screws of any pitch, which are no joints to draw; nor are rotors.
    """
    spatial = page.entry.task_dimension == _SPATIAL_ROWS
    are_screws = page.entry.model.startswith("free") and spatial
    return not are_screws and "rotor" not in page.entry.model


def _text(values: object) -> bytes:
    """Return the JSON text of values as bytes."""
    return (json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


@cache
def _templates() -> Environment:
    """Return the templates of the site; what files brought is escaped in HTML."""
    made = Environment(
        loader=FileSystemLoader(_SITE),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
    )
    made.filters["form"] = format
    return made


def _filled(template: str, values: Mapping[str, object]) -> str:
    """Return a template of the site with its values."""
    return _templates().get_template(template).render(values)


@cache
def _inequivalent() -> dict[str, tuple[int, int]]:
    """Return the two numbers of `INEQUIVALENT` by entry."""
    return dict(json.loads(INEQUIVALENT.read_text("utf-8")))


def _page(page: EntryPage, drawn: bool) -> str:
    """Return the page of an entry; `drawn` says whether there is a drawing of its arm."""
    asked = page.entry
    measure = _MEASURES.get(asked.formulation, measures.locked_singular_values)
    # What each set of locked joints leaves, in the order of the sets.
    left = measure(page.jacobian, asked.failures).tolist()
    sets = measures.locked_sets(page.jacobian, asked.failures)
    values = {
        "page": page,
        "drawn": drawn,
        "evidence": EVIDENCE[asked.bound.kind] if asked.bound.certified else None,
        "symmetries": count_symmetries(page.jacobian),
        "inequivalent": _inequivalent().get(asked.name),
        "failures": sorted(zip(left, sets, strict=True)),
        "tied": sum(value <= min(left) + TIE for value in left),
        "most": _MOST_SETS,
    }
    return _filled("entry.html.j2", values)


def _crate(sizes: dict[str, int], date: str) -> dict[str, Any]:
    """Return the metadata as an RO-Crate, from the size of each file in bytes."""
    kinds = MimeTypes()  # those of Python, not of the machine
    listed = [
        {
            "@id": name,
            "@type": "File",
            "contentSize": str(size),
            "encodingFormat": kinds.guess_type(name)[0] or "text/plain",
        }
        for name, size in sizes.items()
    ]
    licence = "https://creativecommons.org/licenses/by/4.0/"
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": "The lockedjoint atlas: the best failure-tolerant Jacobians known",
        "description": "Jacobians of arms of which some joints lock, with the least singular "
        "value that is left, proved, and the sharpest bound. "
        f"Missing, for the owner to add: {'; '.join(MISSING)}.",
        "datePublished": date,
        "version": version("lockedjoint"),
        "license": {"@id": licence},
        "author": {"@id": "#developers"},
        "hasPart": [{"@id": one["@id"]} for one in listed],
    }
    about = {
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    people = {
        "@id": "#developers",
        "@type": "Organization",
        "name": "The lockedjoint developers",
    }
    terms = {"@id": licence, "@type": "CreativeWork", "name": "CC-BY 4.0"}
    graph = [about, root, people, terms, *listed]
    return {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}
