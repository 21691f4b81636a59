"""The folder of a run: it holds the files of one complete run, or none of them.

A run writes its files into the subfolder `INCOMPLETE`. When the run is complete its files
replace those of the run before, and one of them comes last: where that file is, all files are
of the same run.
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

from lockedjoint.formulations.io.files import prepare_file, prepare_folder
from lockedjoint.nlp.errors import FileError

#: Subfolder of what is being computed.
INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class RunFolder:
    """The output folder of a run.

    Attributes
    ----------
    folder
        The output folder.
    last
        Name of the file that is put in place last. The caller writes it first of all: it
        marks the subfolder as a run's.
    """

    folder: Path
    last: str

    @classmethod
    def begin(cls, folder: Path, last: str, *others: str) -> "RunFolder":
        """Make sure, before any work, that files of these names can be written; start empty.

        Raises
        ------
        FileError
            If the folder or one of the files cannot be written to, or its subfolder
            `INCOMPLETE` has files that are not of an earlier run.
        """
        prepare_folder(folder)
        for name in (last, *others):
            prepare_file(folder / name, "output file")
        made = cls(folder, last)
        made.discard()
        prepare_folder(made.part)
        return made

    @property
    def part(self) -> Path:
        """The subfolder that the run writes into."""
        return self.folder / INCOMPLETE

    def discard(self) -> None:
        """Remove what a run that did not finish left, and nothing of anybody else's."""
        if not self.part.exists():
            return
        if not (self.part / self.last).is_file() and any(self.part.iterdir()):
            raise FileError(
                "folder", str(self.part), f"one of an earlier run, with {self.last}"
            )
        shutil.rmtree(self.part)

    def publish(self) -> None:
        """Put the files of the complete run in place of those of the run before."""
        files = [path for path in self.part.rglob("*") if path.is_file()]
        (self.folder / self.last).unlink(missing_ok=True)
        for path in sorted(files, key=lambda path: path == self.part / self.last):
            target = self.folder / path.relative_to(self.part)
            target.parent.mkdir(exist_ok=True)
            path.replace(target)
        shutil.rmtree(self.part)
