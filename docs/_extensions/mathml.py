"""Formulas as MathML: browsers draw it themselves, without a script and without a network.

The mathematical font goes with the site, since not every machine has one. It is STIX Two Math
(SIL Open Font License), as the package ziamath carries it, cut down to what formulas need.
"""

from __future__ import annotations

import re
from html import escape
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from fontTools import subset
from latex2mathml.converter import convert

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.config import Config
    from sphinx.writers.html5 import HTML5Translator

TAG = re.compile(r"\\tag\{(.*?)\}")
GLYPHS = "U+20-7E,U+A0-FF,U+2C6-2DD,U+302-304,U+370-3FF,U+2010-22FF,U+2308-230B,U+27E8-27EF,"
GLYPHS += "U+27F9-27FA,U+2AAF-2AB0,U+1D400-1D7FF"
# What the converter leaves: bars and slashes that stretch or stand apart, relations taken for
# variables.
BAR = '<mo stretchy="false" lspace="0" rspace="0">'
REPAIRS = {
    "<mo>&#x02016;</mo>": f"{BAR}‖</mo>",
    '<mo stretchy="false">&#x0007C;</mo>': f"{BAR}|</mo>",
    "<mo>&#x0002F;</mo>": '<mo lspace="0" rspace="0">/</mo>',
    "<mi>&#x02AAF;</mi>": "<mo>⪯</mo>",
    "<mi>&#x02AB0;</mi>": "<mo>⪰</mo>",
}
# Names of functions, which the converter writes as variables: browsers leave no space beside
# those. None is needed after an operator, nor before another function or a bracket.
FUNCTION = re.compile(
    r"(?P<begins><mrow>|(?<!&#x00029;)(?<![|‖])</mo>)?(?P<power><msup>)?"
    r"<mi>(?P<name>sin|cos|log)</mi>"
    r"(?P<ends>(?=(?:<msup>)?<mi>(?:sin|cos|log)<|<mo stretchy=\"false\">&#x00028;))?"
)


def mathml(latex: str, display: str) -> str:
    """Return a formula as MathML, ``inline`` or ``block``."""
    # The bold digit itself: browsers know no other way to make a number bold.
    formula = convert(latex.replace(r"\mathbf{1}", "𝟏"), display=display)
    for wrong, right in REPAIRS.items():
        formula = formula.replace(wrong, right)
    return FUNCTION.sub(apart, formula)


def apart(function: re.Match[str]) -> str:
    """Return the name of a function, with a thin space where no operator or bracket is."""
    before, power = function["begins"] or "", function["power"] or ""
    left = "0" if before else "0.167em"
    right = "0" if function["ends"] is not None else "0.167em"
    return f'{before}{power}<mo lspace="{left}" rspace="{right}">{function["name"]}</mo>'


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    writer.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def display(writer: HTML5Translator, node: nodes.math_block) -> None:
    r"""Write a formula of its own, its number from ``\tag`` beside it."""
    latex = node.astext()
    number = TAG.search(latex)
    tag = f'<span class="eqno">({escape(number[1])})</span>' if number else ""
    formula = mathml(TAG.sub("", latex), "block")
    writer.body.append(f'<div class="math">{formula}{tag}</div>\n')
    raise nodes.SkipNode


def add_font(app: Sphinx, config: Config) -> None:
    """Put the font among the site's static files."""
    folder = Path(app.confdir) / "_build" / "fonts"
    folder.mkdir(parents=True, exist_ok=True)
    config.html_static_path.append(str(folder))
    font = folder / "math.woff"
    if not font.exists():
        with as_file(files("ziamath") / "fonts" / "STIXTwoMath-Regular.ttf") as whole:
            wanted = [f"--unicodes={GLYPHS}", "--layout-features=*", "--flavor=woff"]
            subset.main([str(whole), *wanted, f"--output-file={font}"])


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    app.connect("config-inited", add_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
