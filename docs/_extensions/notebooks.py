"""Every page with code as a notebook to download, and its shell cells as a shell has them.

A notebook is the page without its links to other pages, which it does not come with. Nothing
has been run in it. On the page, the first line of a shell cell, ``%%bash``, is left out: what
is shown, and copied, can be pasted into a shell.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nbformat
from docutils import nodes
from myst_nb.core.read import read_myst_markdown_notebook
from sphinx.transforms.post_transforms import SphinxPostTransform

if TYPE_CHECKING:
    from sphinx.application import Sphinx

NOTEBOOK = "---\nfile_format: mystnb\n"
FOLDER = Path("_build/notebooks")
LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)[^)\s]+\)")
TITLE = re.compile(r"^# .*$", re.MULTILINE)
SHELL = "%%bash\n"


def notebook(text: str, page: str) -> nbformat.NotebookNode:
    """Return a page's text as a notebook."""
    content = TITLE.sub(lambda found: f"{found[0]}\n\n{note(page)}", text, count=1)
    made = read_myst_markdown_notebook(content)
    for number, cell in enumerate(made.cells):
        cell["id"] = f"cell-{number}"  # the same on every build
        if cell.cell_type == "markdown":
            cell.source = LINK.sub(r"\1", cell.source)
    made.metadata = {
        "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}
    }
    nbformat.validate(made)
    return made


def note(page: str) -> str:
    """Say where a notebook is from and what it needs."""
    return (
        f"*This is the page `{page}` of the documentation of lockedjoint. To run it, install\n"
        "the library in a checkout of the repository:\n"
        "`pip install '.[figures,cluster]' jupyterlab`.*"
    )


def write_notebooks(app: Sphinx) -> None:
    """Write all notebooks, at the start of a build."""
    source = Path(app.srcdir)
    for page in sorted(source.rglob("*.md")):
        inside = page.relative_to(source)
        text = page.read_text(encoding="utf-8")
        if inside.parts[0] in ("_build", "reference") or not text.startswith(NOTEBOOK):
            continue
        file = (source / FOLDER / inside).with_suffix(".ipynb")
        file.parent.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook(text, inside.as_posix()), file)


def offer(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the link to a page's notebook below its title."""
    file = FOLDER / f"{docname}.ipynb"
    if (Path(app.srcdir) / file).exists():
        link = f"{{download}}`This page as a notebook </{file.as_posix()}>`"
        source[0] = TITLE.sub(lambda found: f"{found[0]}\n\n{link}", source[0], count=1)


class ShellCells(SphinxPostTransform):
    """Show the cells of ``%%bash`` as a shell's."""

    default_priority = 100

    def run(self, **_: Any) -> None:
        """Leave out the first line, and colour the rest as a shell's."""
        for block in self.document.findall(nodes.literal_block):
            if block.astext().startswith(SHELL):
                code = block.astext().removeprefix(SHELL)
                block["language"] = "bash"
                block.rawsource = code
                block[:] = [nodes.Text(code)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Make notebooks, offer them, and show shell cells."""
    app.connect("builder-inited", write_notebooks)
    app.connect("source-read", offer)
    app.add_post_transform(ShellCells)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
