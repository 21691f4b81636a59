"""A study: rows that are computed one by one, and the folder of tables and the page they fill.

Pages are Markdown: templates beside their studies, filled from the rows of tables.

A run writes into the folder `INCOMPLETE` within, after every row. When all rows are there, its
files replace those of the run before, and the page comes last: a folder with a page holds the
files of one complete run.
"""

import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import lru_cache
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from lockedjoint.formulations.io.files import prepare_file, prepare_folder, write_text
from lockedjoint.formulations.io.table import Table, header, read_rows, versions, written
from lockedjoint.nlp.errors import FileError

#: Within the folder of a result: what is being computed.
INCOMPLETE = "incomplete"
_BEGUN = "Interrupted or still running: nothing is here yet.\n"
Rows = Mapping[str, Sequence[Any]]
# Below this an isotropy defect, or a residual, is the solver's tolerance and not a number; and
# a gap, in percent, is none.
_NOTHING, _CLOSED = 1e-6, 1e-4


@dataclass(frozen=True)
class Effort:
    """How a study is run."""

    seed: int = 0
    starts: int | None = None  # of each row; None for as many as the study usually makes
    workers: int = 1
    progress: Callable[[str], None] = lambda _: None  # told what is being done, in a few words
    bars: bool = False  # whether many starts show a progress bar


@dataclass(frozen=True)
class Result:
    """What a run of a study came to."""

    rows: tuple[Any, ...]  # of all tables, in the order in which they were computed
    complete: bool
    complaint: str = ""  # what is wrong with the rows, in a sentence, or nothing


@dataclass(frozen=True)
class Study:
    """What fills one folder of results.

    Its command runs this study alone, and `takes` so long on two cores, in words.
    """

    name: str  # of the folder
    title: str  # in a few words, for the front page
    page: str  # the folder's Markdown page
    template: Path  # of the page, with the block ``finding``
    tables: Mapping[str, type[Any]]  # kinds of rows by the CSV file's stem, the main one first
    command: str
    takes: str
    # Yields the rows, given a folder for files of its own. A KeyboardInterrupt ends it there.
    compute: Callable[[Effort, Path], Iterator[Any]]
    long: bool = False  # over ten minutes, packages of robots, or an idle machine
    settings: Mapping[str, object] = field(default_factory=dict)  # more for the template
    # What is wrong with the rows, in a sentence, or nothing.
    complain: Callable[[Sequence[Any]], str] = lambda _: ""

    def run(
        self, folder: Path, effort: Effort, each: Callable[[Any], object] = lambda _: None
    ) -> Result:
        """Run the study into a folder; tables and page are written after every row.

        `each` is then called with the row. The result is not complete if the user interrupted;
        what was done is then in the folder's `INCOMPLETE`, and an earlier result stays.
        LockedJointError if the study cannot be run, or the folder not be written to.
        """
        prepare_folder(folder)
        for name in (self.page, *(f"{stem}.csv" for stem in self.tables)):
            prepare_file(folder / name, "output file")
        part = folder / INCOMPLETE
        self._discard(part)
        write_text(prepare_folder(part) / self.page, _BEGUN)
        rows: list[Any] = []
        try:
            for row in self.compute(effort, part):
                rows.append(row)
                self._write(part, rows, effort.seed, complete=False)
                each(row)
        except KeyboardInterrupt:
            return Result(tuple(rows), complete=False)
        except Exception:
            self._discard(part)
            raise
        self._write(part, rows, effort.seed, complete=True)
        self._publish(part, folder)
        return Result(tuple(rows), complete=True, complaint=self.complain(rows))

    def read(self, folder: Path) -> Rows:
        """Return the rows of each table in a folder, none where a table is missing.

        FileError if a table is not of this version.
        """
        rows: dict[str, Sequence[Any]] = {}
        for stem, kind in self.tables.items():
            path = folder / f"{stem}.csv"
            rows[stem] = read_rows(path, kind) if path.exists() else []
        return rows

    def finding(self, tables: Rows) -> str:
        """Return what the tables show as one paragraph, empty if there is nothing to say."""
        return prose(block(self.template, "finding", self._values(tables)))

    def _discard(self, part: Path) -> None:
        """Remove what a run that did not finish left, and nothing of anybody else's."""
        if not part.exists():
            return
        if not (part / self.page).is_file() and any(part.iterdir()):
            raise FileError("folder", str(part), f"one of an earlier run, with {self.page}")
        shutil.rmtree(part)

    def _write(self, part: Path, rows: Sequence[Any], seed: int, complete: bool) -> None:
        for place, (stem, kind) in enumerate(self.tables.items()):
            same = [row for row in rows if isinstance(row, kind)]
            if same or place == 0:
                write_text(part / f"{stem}.csv", Table(kind, same).csv())
        # From the tables as they were written, so that page and tables agree.
        values = {**self._values(self.read(part)), "seed": seed, "complete": complete}
        write_text(part / self.page, page(self.template, values))

    def _publish(self, part: Path, folder: Path) -> None:
        files = [path for path in part.rglob("*") if path.is_file()]
        (folder / self.page).unlink(missing_ok=True)
        for path in sorted(files, key=lambda path: path == part / self.page):
            target = folder / path.relative_to(part)
            target.parent.mkdir(exist_ok=True)
            path.replace(target)
        shutil.rmtree(part)

    def _values(self, tables: Rows) -> dict[str, object]:
        named = {stem.replace("-", "_"): rows for stem, rows in tables.items()}
        return {**self.settings, **named, "rows": tables[next(iter(self.tables))]}


def write_json(path: Path, values: object) -> None:
    """Write values beside a study's tables."""
    write_text(path, json.dumps(values, indent=1) + "\n")


def page(template: Path, values: Mapping[str, object]) -> str:
    """Return a template, filled; it may extend ``page.md.j2`` of this folder."""
    return _environment(template.parent).get_template(template.name).render(values)


def block(template: Path, name: str, values: Mapping[str, object]) -> str:
    """Return one block of a template, filled."""
    loaded = _environment(template.parent).get_template(template.name)
    return "".join(loaded.blocks[name](loaded.new_context(dict(values))))


def prose(text: str) -> str:
    """Return a text as one line: templates break lines where they like."""
    return " ".join(text.split())


def bullets(text: str) -> str:
    """Return the paragraphs of a text, separated by empty lines, as a Markdown list."""
    runs = groupby(text.splitlines(), key=lambda line: bool(line.strip()))
    return "\n".join(f"- {prose(' '.join(lines))}" for full, lines in runs if full)


def listed(text: str, separator: str) -> str:
    """Return the lines of a text that are not empty, joined by a separator."""
    return separator.join(line.strip() for line in text.splitlines() if line.strip())


def rounded_down(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not above it: still a lower bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_FLOOR))


def rounded_up(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not below it: still an upper bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_CEILING))


def outward(number: float, digits: int, *, lower: bool) -> str:
    """Return a lower bound rounded down, or an upper one rounded up, to significant digits."""
    decimals = digits - 1 - Decimal(number).adjusted() if number else 0
    text = (rounded_down if lower else rounded_up)(number, decimals)
    return f"{Decimal(text).normalize():f}"


def known(rows: Iterable[Any], name: str) -> list[Any]:
    """Return the rows whose field of that name is not NaN."""
    return [row for row in rows if getattr(row, name) == getattr(row, name)]


def groups(rows: Iterable[Any], *names: str) -> list[tuple[tuple[Any, ...], list[Any]]]:
    """Return the rows by the values of some fields, in the order of first appearance."""
    grouped: dict[tuple[Any, ...], list[Any]] = {}
    for row in rows:
        grouped.setdefault(tuple(getattr(row, name) for name in names), []).append(row)
    return list(grouped.items())


def by(rows: Iterable[Any], key: str, value: str) -> dict[Any, Any]:
    """Return one field of the rows by another."""
    return {getattr(row, key): getattr(row, value) for row in rows}


def table(rows: Sequence[Any]) -> str:
    """Return rows of one kind as a Markdown table; empty if there are none."""
    return Table(type(rows[0]), rows).markdown() if rows else ""


def aligned(text: str) -> str:
    """Return lines of cells between bars as a Markdown table, headed by the first line."""
    heads, *lines = (line.split(" | ") for line in text.splitlines() if line.strip())
    return written(lines, heads, "pipe")


@lru_cache
def _environment(folder: Path) -> Environment:
    made = Environment(
        loader=FileSystemLoader([folder, Path(__file__).parent]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        # Markdown is of our own numbers, HTML also of what others wrote.
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
    )
    own = (
        *(aligned, bullets, by, groups, known, listed, outward, prose),
        *(rounded_down, rounded_up, table),
    )
    made.filters.update({function.__name__: function for function in own}, form=format)
    made.tests["nan"] = isnan
    made.globals.update(CLOSED=_CLOSED, NOTHING=_NOTHING, header=header, versions=versions)
    return made
