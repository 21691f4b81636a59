"""Progress on a terminal: what is being done, the share that is done, and the time left."""

from __future__ import annotations

import shutil
import sys
from typing import Any

from lockedjoint.nlp.errors import printable

# Columns of the terminal that a bar takes at most.
_WIDTH = 80
# Seconds after which a bar appears: what ends sooner needs none.
_DELAY_SECONDS = 3.0
# Seconds between two drawings of a bar.
_INTERVAL_SECONDS = 0.1
# Characters of what is being done, before the bar.
_LONGEST = 34
_WITH_SHARE = "{desc} {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left"
_WITHOUT_SHARE = "{desc} {elapsed}"


class Bar:
    """One bar on standard error, if that is a terminal, until something is printed."""

    def __init__(self) -> None:
        self._bar: Any = None

    def __call__(self, words: str) -> None:
        """Show a sentence, and the share of the whole if it knows that."""
        if not sys.stderr.isatty():
            return
        if self._bar is None:
            from tqdm import tqdm

            width = min(_WIDTH, shutil.get_terminal_size().columns)
            self._bar = tqdm(
                total=1.0,
                leave=False,
                ncols=width,
                delay=_DELAY_SECONDS,
                mininterval=_INTERVAL_SECONDS,
                file=sys.stderr,
            )
        share = getattr(words, "share", None)
        self._bar.bar_format = _WITHOUT_SHARE if share is None else _WITH_SHARE
        text = printable(str(words), "")
        short = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
        self._bar.set_description_str(short, refresh=False)
        done = self._bar.n if share is None else max(share, self._bar.n)
        self._bar.update(done - self._bar.n)
        self._bar.refresh() if share is None and self._bar.start_t else None

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


#: The bar of the command that runs.
progress = Bar()
