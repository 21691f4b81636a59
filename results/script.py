"""What the scripts of the results share: options, a run, and saving figures."""

import argparse
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from lockedjoint.commands.bars import progress
from lockedjoint.commands.output import INTERRUPTED, UNSUCCESSFUL
from lockedjoint.figures.style import content, kind_of
from lockedjoint.formulations.io.files import write_bytes
from lockedjoint.formulations.io.run_folder import INCOMPLETE
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.errors import LockedJointError
from lockedjoint.nlp.executors import default_workers
from results.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A function that yields the rows of a study, given a folder for files of its own.
Compute: TypeAlias = Callable[[Effort, Path], Iterator[Any]]


def study_of(file: str, compute: Compute, row: type[Any] | None = None, **stated: Any) -> Study:
    """Return the study of a script, which names it, its files and its command.

    `row` is the kind of the only table's rows, unless `tables` are stated.
    """
    name, template = Path(file).stem, Path(file).with_suffix(".md.j2")
    command = f"python results/{name}/{name}.py"
    files = {"page": f"{name}.md", "tables": {name: row}, "template": template}
    return Study(**{"name": name, "command": command, **files, **stated}, compute=compute)


def save(figure: "Figure", path: Path) -> None:
    """Write a figure, in the format that the file's name asks for."""
    write_bytes(path, content(figure, kind_of(path)))


def main(study: Study, file: str) -> NoReturn:
    """Run a study as its script says, into the script's own folder if no other is given."""
    words = f"{study.name}: {study.title}. Takes {study.takes}."
    options = parser(words, Path(file).parent).parse_args()
    sys.exit(run(study, options, options.out))


def parser(words: str, folder: Path) -> argparse.ArgumentParser:
    """Return the options of every script."""
    made = argparse.ArgumentParser(description=words)
    made.add_argument("--starts", type=int, metavar="K", help="random starts of each row")
    made.add_argument("--seed", type=int, default=0, help="of all random starts (default 0)")
    made.add_argument("--workers", type=int, default=default_workers(), help="processes")
    made.add_argument("--out", type=Path, default=folder, help=f"folder (default {folder})")
    return made


def run(study: Study, options: argparse.Namespace, out: Path) -> int:
    """Run a study and return the exit status: 1 if something is wrong, 130 after Ctrl-C."""
    effort = Effort(options.seed, options.starts, options.workers, progress)
    print(f"{study.name}: takes {study.takes}", file=sys.stderr)
    try:
        result = study.run(out, effort)
    except Exception as error:  # other studies may still run
        if not isinstance(error, LockedJointError):
            traceback.print_exc()
        print(f"{study.name}: {error}", file=sys.stderr)
        return UNSUCCESSFUL
    if not result.complete:
        rest = f"what was done is in {out / INCOMPLETE}, the rest is missing"
        print(f"{study.name}: interrupted, {rest}", file=sys.stderr)
        return INTERRUPTED
    if result.complaint:
        print(f"{study.name}: {result.complaint}", file=sys.stderr)
        return UNSUCCESSFUL
    return 0
