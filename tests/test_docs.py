"""What stands on the site's pages is true: cells run elsewhere, commands and names exist."""

import csv
import re
import runpy
import shlex
import tomllib
from collections import Counter
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

import lockedjoint as lj
from lockedjoint.commands.app import app
from lockedjoint.formulations import max_min
from lockedjoint.formulations.comparison import ComparisonRow
from lockedjoint.formulations.encodings.factors import ENCODINGS

ROOT = Path(__file__).parents[1]
DOCS, MADE = ROOT / "docs", ("_build", "results")
OWN = [page for page in DOCS.rglob("*.md") if page.parts[len(DOCS.parts)] not in MADE]
PAGES = [ROOT / "README.md", *sorted(OWN)]
CELL = re.compile(r"^```\{code-cell\} ipython3\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TAGS = re.compile(r"\A:tags:.*\n\n*")
SHELL = "%%bash\n"
BLOCK = re.compile(r"^ *```(?:bash|console)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
COMMANDS = {name: app.get_command(click.Context(app), name) for name in app.list_commands(None)}


def name(page):
    return page.relative_to(ROOT).as_posix()


def cells(page):
    return [TAGS.sub("", cell) for cell in CELL.findall(page.read_text("utf-8"))]


def shell_lines(page):
    """Return the commands of a page, of several lines as one, without prompts and comments."""
    blocks = [cell.removeprefix(SHELL) for cell in cells(page) if cell.startswith(SHELL)]
    for block in BLOCK.findall(page.read_text("utf-8")):
        lines = re.sub(r"\\\n\s*", "", block).splitlines()
        prompts = any(line.lstrip().startswith("$ ") for line in lines)
        blocks += [line.lstrip()[2:] for line in lines if line.lstrip().startswith("$ ")]
        blocks += [] if prompts else lines
    joined = [re.sub(r"\\\n\s*", "", block) for block in blocks]
    return [line.strip() for block in joined for line in block.splitlines()]


def calls(page):
    """Return the words of each use of the command ``lockedjoint`` on a page."""
    found = []
    for line in shell_lines(page):
        parts = re.split(r"&&|\||;(?![^']*')", line)
        used = [part for part in parts if re.match(r"\s*(\S*/)?lockedjoint ", part)]
        found += [shlex.split(part, comments=True)[1:] for part in used]
    return found


def check_options(command, words):
    """Assert that a command, or its inner command, has each option among the words."""
    named = COMMANDS[command]
    known = options_of(named)
    for word in words:
        if word in getattr(named, "commands", {}):
            named = named.commands[word]
            known = options_of(named)
        elif re.match(r"\[?--[a-z]", word):
            assert word.strip("[]").partition("=")[0] in known, (command, word)


def options_of(named):
    return {option for one in named.params for option in one.opts} | {"--help"}


@pytest.mark.parametrize("page", [p for p in PAGES if calls(p)], ids=name)
def test_every_command_and_option_exists(page):
    for command, *words in calls(page):
        if command.startswith("--"):
            assert command in ("--version", "--help", "--plugin")
            if command != "--plugin":
                continue
            _, command, *words = words
        check_options(command, words)


# Code within a line or two of text.
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
FENCED = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)


def calls_in_text(page):
    """Return the words of what the text of a page names that begins with a command."""
    text = FENCED.sub("", page.read_text("utf-8"))
    found = [words.removeprefix("lockedjoint ").split() for words in INLINE.findall(text)]
    return [words for words in found if words and words[0] in COMMANDS]


@pytest.mark.parametrize("page", [p for p in PAGES if calls_in_text(p)], ids=name)
def test_options_in_the_text_are_those_of_the_command_before_them(page):
    for command, *words in calls_in_text(page):
        check_options(command, words)


def every_option():
    """Return the options of all commands."""
    known = {"--version", "--help", "--plugin"}
    for named in COMMANDS.values():
        for one in (named, *getattr(named, "commands", {}).values()):
            known |= {option for parameter in one.params for option in parameter.opts}
    return known


# Not ours: of tools that the pages also speak of.
FOREIGN = {"--all", "--no-dashboard", "--no-deps", "--once"}
CODE = re.compile(r"`([^`\n]*--[a-z][^`\n]*)`")


def options_of_scripts(text):
    """What the scripts of results/ that a text names have as options, from their source."""
    paths = {ROOT / path for path in re.findall(r"results/[\w/]+\.py", text)}
    sources = [path.read_text("utf-8") for path in paths if path.is_file()]
    return {one for source in sources for one in re.findall(r"\"(--[a-z][a-z-]*)\"", source)}


@pytest.mark.parametrize("page", [*PAGES, ROOT / "SECURITY.md"], ids=name)
def test_options_that_the_text_names_exist(page):
    scripts = options_of_scripts(page.read_text("utf-8"))
    for words in CODE.findall(page.read_text("utf-8")):
        if not re.match("(pip|apt-get|git|docker|python -m (venv|pip|pytest)) ", words):
            named = set(re.findall(r"--[a-z][a-z-]*", words))
            assert named <= every_option() | FOREIGN | scripts, words


INSIDE = re.compile(r"^\s*(?:from|import) +(?:lockedjoint\.|lockedjoint +import)", re.MULTILINE)
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_examples_import_the_public_names_alone(page):
    """What a reader copies goes on working when a module moves."""
    for cell in [*cells(page), *PYTHON.findall(page.read_text("utf-8"))]:
        assert not INSIDE.search(cell), cell


def test_a_page_says_what_every_column_of_compare_means():
    page = (DOCS / "campaigns.md").read_text("utf-8").partition("## Columns of compare\n")[2]
    rows = re.findall(r"^\| (`.*?`) \| \S", page, re.MULTILINE)
    named = [column for row in rows for column in re.findall(r"`(\w+)`", row)]
    expected = [field.name for field in fields(ComparisonRow)]
    assert named[: len(expected)] == expected


@pytest.mark.parametrize("page", ["formulations.md", "glossary.md"])
def test_a_page_names_every_encoding(page):
    text = (DOCS / page).read_text("utf-8")
    assert all(f"`{one}`" in text for one in (*max_min.WITHOUT_FACTORS, *ENCODINGS))


def test_the_page_on_proofs_counts_what_the_atlas_has():
    text = (DOCS / "atlas_proofs.md").read_text("utf-8")
    with (ROOT / "results/atlas/atlas.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # The page's words for the kinds of the table, where they differ.
    words = {"tight": "residual", "null-vector": "signs of the null vector"}
    kinds = Counter(re.sub(r"^proved \((.*)\)$", r"\1", row["kind"]) for row in rows)
    table = text.partition("| known by |")[2]
    shown = re.findall(r"^\| ([a-z, -]+) \| (\d+)", table, re.MULTILINE)
    assert dict(shown) == {words.get(kind, kind): str(count) for kind, count in kinds.items()}
    isolated = sum(row["family"] == "0" for row in rows)
    proved = sum(row["locally_optimal"] == "True" for row in rows)
    assert f"Of {isolated} isolated entries {proved} are proved" in text
    assert f"The other {isolated - proved} are not proved" in text


def test_rooms_are_listed_in_the_order_of_the_contracts():
    """A room imports only from rooms further down in its list."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    for storey in ("lockedjoint", "formulations"):
        table = text.partition(f"| room of `{storey}/` |")[2].partition("\n\n")[0]
        cells = re.findall(r"^\| (`.*?`) \|", table, re.MULTILINE)
        listed = [re.findall(r"`(\w+)", cell) for cell in cells]
        place = {room: k for k, rooms in enumerate(listed) for room in rooms}
        whole = "lockedjoint" if storey == "lockedjoint" else f"lockedjoint.{storey}"
        [layers] = [one["layers"] for one in contracts if one.get("containers") == [whole]]
        order = [[place[room] for room in one.split(" : ") if room in place] for one in layers]
        order = [places for places in order if places]
        assert sum(map(len, order)) == len(place)
        for above, below in pairwise(order):
            assert max(above) < min(below)


@pytest.fixture(scope="module")
def made():
    """The module that makes pages of the reference."""
    return SimpleNamespace(**runpy.run_path(str(DOCS / "made_pages.py")))


def test_the_reference_has_every_public_name_once(made):
    entries = re.findall(r"^### lj\.(\w+)$", made.library_page(), re.MULTILINE)
    assert sorted(entries) == lj.__all__


def test_the_reference_has_every_command_under_a_heading(made):
    page = made.commands_page()
    headings = re.findall(r"^###? lockedjoint ?(.*)$", page, re.MULTILINE)
    inner = [
        f"{name} {below}"
        for name, one in COMMANDS.items()
        for below in getattr(one, "commands", {})
    ]
    assert sorted(headings) == sorted(["", *COMMANDS, *inner])
    for name in COMMANDS:
        assert f"](#lockedjoint-{name}):" in page
