"""Progress on a terminal: what is being done, the share that is done, and the time left."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Any

from lockedjoint.nlp.errors import printable

# Largest number of columns of the terminal that a bar takes.
_WIDTH = 80
# Seconds after which a bar appears: what ends sooner needs none.
_DELAY_SECONDS = 3.0
# Seconds between two drawings of a bar.
_INTERVAL_SECONDS = 0.1
# Largest number of characters before the bar, which say what is being done.
_LONGEST = 34
# Forms of a line, in tqdm's words: with the share that is done, and without.
_WITH_SHARE = "{desc} {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left"
_WITHOUT_SHARE = "{desc} {elapsed}"


class Bar:
    """One bar on standard error, if that is a terminal, until something is printed."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._begun = self._drawn = 0.0

    def __call__(self, words: str) -> None:
        """Show a sentence, and a bar if it is a `Step` that knows its share of the whole."""
        if not sys.stderr.isatty():
            return
        share = getattr(words, "share", None)
        form = _WITHOUT_SHARE if share is None else _WITH_SHARE
        now = time.monotonic()
        if self._bar is None:
            self._bar, self._begun = _new_bar(form), now
        self._bar.bar_format = form
        text = printable(str(words), "")
        short = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
        self._bar.set_description_str(short, refresh=False)
        self._bar.n = max(share or 0.0, self._bar.n)
        waited = now - self._begun >= _DELAY_SECONDS
        if waited and now - self._drawn >= _INTERVAL_SECONDS:
            self._bar.refresh()
            self._drawn = now

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _new_bar(form: str) -> Any:
    """Return a bar of tqdm, whose total is 1."""
    from tqdm import tqdm

    terminal = shutil.get_terminal_size()  # tqdm hides a bar if the system says 0 lines
    how: dict[str, Any] = {
        "leave": False,
        "ncols": min(_WIDTH, terminal.columns),
        "nrows": terminal.lines,
        "delay": _DELAY_SECONDS,
        "file": sys.stderr,
    }
    return tqdm(total=1.0, bar_format=form, **how)


#: The bar of the command that runs.
progress = Bar()
