"""How far a computation is: sentences that know their share, and bars that show it."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeAlias


class Step(str):
    """What is being done, in a few words; and which share of the whole is done, 0 to 1."""

    __slots__ = ("share",)
    share: float | None

    def __new__(cls, words: str, share: float | None = None) -> Step:
        """Return the words; the share is None where nobody knows it."""
        step = super().__new__(cls, words)
        step.share = share
        return step


#: A function that is told how far a computation is: a `Step`, or a sentence without a share.
Progress: TypeAlias = Callable[[str], None]


def part_of(progress: Progress, first: float, last: float) -> Progress:
    """Return what tells of a part of a computation, from one share of the whole to another.

    `progress` hears of the whole; what is returned is told of the part, whose shares 0 to 1
    become `first` to `last`.
    """

    def tell(words: str) -> None:
        """Tell the whole's progress of a step of the part."""
        share = getattr(words, "share", None)
        progress(Step(words, first if share is None else first + (last - first) * share))

    return tell


def tqdm_class() -> Any:
    """Return tqdm's class of bars: in a notebook the one of ipywidgets, where that is there.

    ``tqdm.auto`` without ipywidgets shows a warning in every notebook.
    """
    if find_spec("ipywidgets") is not None:
        from tqdm.auto import tqdm as of_notebooks

        return of_notebooks
    from tqdm import tqdm

    return tqdm
