"""A study: what fills one folder of the results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Effort:
    """How a study is run.

    Attributes
    ----------
    seed
        Of all random starts.
    starts
        Random starts of each row; None for as many as the study's own command makes.
    workers
        Processes.
    progress
        Is told what is being done.
    """

    seed: int = 0
    starts: int | None = None
    workers: int = 1
    progress: Callable[[str], None] = lambda _: None

    def starts_or(self, usual: int) -> int:
        """Return the number of starts, `usual` if none was asked for."""
        return self.starts or usual


@dataclass(frozen=True)
class Study:
    """What fills one folder of the results.

    Attributes
    ----------
    name
        Of the folder.
    title
        In a few words, for the front page.
    page, table
        The folder's Markdown page, and the CSV file that it was made from.
    command
        What makes it by itself.
    takes
        How long that takes on two cores, in words.
    long
        Whether it takes over ten minutes.
    run
        Computes it into a folder that exists; returns what is wrong with what was found, in a
        sentence, or nothing.
    finding
        Returns what it shows, as a paragraph made from the table in a folder.
    """

    name: str
    title: str
    page: str
    table: str
    command: str
    takes: str
    long: bool
    run: Callable[[Path, Effort], str]
    finding: Callable[[Path], str]
