"""The readme and the addresses of the package, as a package index shows them.

A package index shows the readme outside the repository, where relative links lead nowhere. They
become addresses in the repository that pyproject.toml names, in ``hooks.custom``. As long
as it names none, the text of a link stays, and pictures are left out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

# Text and target of a link in Markdown, with "!" before that of a picture.
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
# Marks of the tests, such as <!-- table -->.
_MARK = re.compile(r"^<!-- [a-z ]+ -->\n", re.MULTILINE)
# What follows the address of a repository: files as pages, files as they are, and other pages.
_PAGES = "blob"
_FILES = "raw"
_BRANCH = "main"


class MetadataHook(MetadataHookInterface):
    """What hatchling calls when it builds the package."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fill in the readme and the addresses."""
        repository = self.config.get("repository", "").rstrip("/")
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        content = readme_for_index(text, repository)
        metadata["readme"] = {"content-type": "text/markdown", "text": content}
        metadata["urls"] = addresses(repository, self.config.get("documentation", ""))


def addresses(repository: str, documentation: str) -> dict[str, str]:
    """Return the addresses of the project by name; none that is not known."""
    known = {} if not documentation else {"Documentation": documentation}
    if repository:
        known |= {
            "Repository": repository,
            "Issues": f"{repository}/issues",
            "Changelog": f"{repository}/{_PAGES}/{_BRANCH}/CHANGELOG.md",
        }
    return known


def readme_for_index(text: str, repository: str) -> str:
    """Return the readme without relative links.

    Parameters
    ----------
    text
        The readme of the repository, in Markdown.
    repository
        The address of the repository; empty if it is not known.
    """

    def replaced(link: re.Match[str]) -> str:
        picture, words, target = link.groups()
        if re.match(r"https?:|#|mailto:", target):
            return link[0]
        if not repository:
            return "" if picture else words
        kind = _FILES if picture else _PAGES
        return f"{picture}[{words}]({repository}/{kind}/{_BRANCH}/{target})"

    return re.sub(r"\n{3,}", "\n\n", _LINK.sub(replaced, _MARK.sub("", text)))
