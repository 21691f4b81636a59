"""Docstrings write norms as |v|, which reStructuredText would take for a substitution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from docutils.parsers.rst.states import Inliner

if TYPE_CHECKING:
    import re

    from sphinx.application import Sphinx


def plain(_: Inliner, match: re.Match[str], __: int) -> tuple[str, list[Any], str, list[Any]]:
    """Take the bar for text."""
    end = match.end("start")
    return match.string[:end], [], match.string[end:], []


def setup(_: Sphinx) -> dict[str, Any]:
    """Let bars be text in every page."""
    Inliner.dispatch["|"] = plain
    return {"parallel_read_safe": True, "parallel_write_safe": True}
