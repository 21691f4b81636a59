"""Links that work on a repository's web site, made to work here too.

A link from one Markdown file to another is resolved as the repository has it. The README and
the tables in the folders of ``results/`` are pages of this site, under other names.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

LINK = re.compile(r"\]\((?P<target>[^)\s:#]+\.md)(?P<anchor>#[^)\s]*)?\)")
REPOSITORY = Path(__file__).parents[2]


def page_of(file: Path) -> str | None:
    """Return the page that shows a Markdown file of the repository, if there is one."""
    parts = file.relative_to(REPOSITORY).parts if file.is_relative_to(REPOSITORY) else ()
    if parts[:1] == ("docs",):
        return "/" + "/".join(parts[1:])
    if parts == ("README.md",):
        return "/index.md"
    if parts == ("results", "README.md"):
        return "/results/index.md"
    if parts[:1] == ("results",) and len(parts) == 3:
        return f"/results/{results_page(file)}"
    return None


def results_page(file: Path) -> str:
    """Return the page of a file in a folder of ``results/``: the folder's name if it is alone.

    Beside a README, any other file adds its own name.
    """
    beside = file.name != "README.md" and file.with_name("README.md").exists()
    return f"{file.parent.name}_{file.name}" if beside else f"{file.parent.name}.md"


def add_results(app: Sphinx) -> None:
    """Write a page for each Markdown file in a folder of ``results/``: it includes the file."""
    for file in sorted((REPOSITORY / "results").glob("*/*.md")):
        page = Path(app.srcdir) / "results" / results_page(file)
        shown = file.relative_to(REPOSITORY).as_posix()
        content = f"```{{include}} ../../{shown}\n:relative-images:\n```\n"
        if not page.exists() or page.read_text(encoding="utf-8") != content:
            page.write_text(content, encoding="utf-8")


def relinked(text: str, folder: Path) -> str:
    """Return Markdown of a file in `folder` with its links as this site has them."""

    def link(match: re.Match[str]) -> str:
        if match["target"].startswith("/"):
            return match[0]
        page = page_of((folder / match["target"]).resolve())
        return match[0] if page is None else f"]({page}{match['anchor'] or ''})"

    return LINK.sub(link, text)


def read(app: Sphinx, docname: str, source: list[str]) -> None:
    """Relink a page."""
    source[0] = relinked(source[0], Path(app.env.doc2path(docname)).parent)


def included(app: Sphinx, path: Path, _: str, source: list[str]) -> None:
    """Relink a file that a page includes."""
    source[0] = relinked(source[0], (Path(app.srcdir) / path).resolve().parent)


def setup(app: Sphinx) -> dict[str, Any]:
    """Relink pages as they are read."""
    app.connect("builder-inited", add_results)
    app.connect("source-read", read)
    app.connect("include-read", included)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
