"""Formulas as MathML: browsers draw it themselves, without a script and without a network."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING, Any

from docutils import nodes
from latex2mathml.converter import convert

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

TAG = re.compile(r"\\tag\{(.*?)\}")


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def display(writer: HTML5Translator, node: nodes.math_block) -> None:
    r"""Write a formula of its own, its number from ``\tag`` beside it."""
    latex = node.astext()
    number = TAG.search(latex)
    tag = f'<span class="eqno">({escape(number[1])})</span>' if number else ""
    formula = convert(TAG.sub("", latex), display="block")
    writer.body.append(f'<div class="math">{formula}{tag}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
