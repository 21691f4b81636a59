"""Check every internal link of a built site, anchors included: `check_links.py FOLDER`.

What comes in: a folder of HTML pages, as Sphinx builds them. What goes out: the number of links
and pages, and a line ``page: link`` for each internal link whose file or anchor is missing. The
exit status is 1 if there is such a link, or no page. Links to other sites are not followed.
"""

import re
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

ROOT = Path(sys.argv[1]).resolve()
# The target of a link, a picture, a script or a style sheet.
LINK = re.compile(r'(?:href|src)="([^"]+)"')


@cache
def anchors(page: Path) -> set[str]:
    """Return the anchors of a page: the values of its ``id`` attributes."""
    return set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8")))


def broken(page: Path, link: str) -> bool:
    """Say whether an internal link, as it is written on a page, leads nowhere.

    False for links to other sites. Only of HTML pages are anchors looked up.
    """
    parts = urlsplit(link)
    if parts.scheme or parts.netloc or link == "#":
        return False
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if not target.exists():
        return True
    named = parts.fragment and target.suffix == ".html"
    return bool(named) and unquote(parts.fragment) not in anchors(target)


pages = sorted(ROOT.rglob("*.html"))
found = [(page, link) for page in pages for link in LINK.findall(page.read_text("utf-8"))]
wrong = sorted({f"{p.relative_to(ROOT)}: {link}" for p, link in found if broken(p, link)})
print(f"{len(found)} links on {len(pages)} pages, {len(wrong)} broken", *wrong, sep="\n")
sys.exit(bool(wrong) or not pages)
