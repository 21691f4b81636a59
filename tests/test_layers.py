"""The rooms are in order: imports go down only, never in a circle, and the tree stays small.

Every import counts, also one inside a function or for type checking. Only the search for
circles leaves out the imports for type checking, because they never run.
"""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("lockedjoint", "nlp", "formulations")
STATEMENTS = (
    *("residual", "max_min", "isotropy", "trade_off", "unequal_max_min", "appendix"),
    *("catalogue", "isotropy_equations", "manipulability", "reduced"),
)
BELOW = ("bounds", "realise", "files", "measures", "existence", "joints")
ABOVE = (
    "commands",
    "studies",
    "figures",
    "campaign",
    "robots",
    "atlas",
    "solving",
    "reproduction",
)
# From the top to the ground. The statements share one floor.
FLOORS = (
    ("lockedjoint", "formulations.__main__"),
    *((f"formulations.{room}",) for room in ABOVE),
    tuple(f"formulations.{room}" for room in STATEMENTS),
    *((f"formulations.{room}",) for room in BELOW),
    ("nlp", "formulations"),
)
ROOMS, MODULES = 29, 265


class Import(NamedTuple):
    """One module imports another one of this repository."""

    file: str
    line: int
    importer: str
    imported: str
    runs: bool  # False for type checking

    def __str__(self):
        return f"{self.file}:{self.line} imports {self.imported}"


def modules_of(root):
    """Files by the dotted name of their module."""
    found = {}
    for package in PACKAGES:
        for file in (root / package).rglob("*.py"):
            parts = file.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def for_type_checking(tree):
    """Nodes below `if TYPE_CHECKING:`."""
    return {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
        for statement in node.body
        for inner in ast.walk(statement)
    }


def names_in(node, package):
    """Dotted names that an import statement mentions, from the longest possible."""
    if isinstance(node, ast.Import):
        yield from (one.name for one in node.names)
    elif isinstance(node, ast.ImportFrom):
        parents = package.split(".")[: -(node.level - 1) or None] if node.level else []
        origin = ".".join([*parents, *filter(None, [node.module])])
        yield from (f"{origin}.{one.name}" for one in node.names)


def imports_of(root):
    """Every import of a module of this repository by another."""
    modules = modules_of(root)
    for importer, file in sorted(modules.items()):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        only_types = for_type_checking(tree)
        package = importer if file.name == "__init__.py" else importer.rpartition(".")[0]
        for node in ast.walk(tree):
            for name in names_in(node, package):
                # `from package import name`: a module, or something inside the package.
                known = name if name in modules else name.rpartition(".")[0]
                if known in modules and known != importer:
                    place = file.relative_to(root).as_posix()
                    runs = node not in only_types
                    yield Import(place, node.lineno, importer, known, runs)


def floor(module):
    """Return how far down a module lives; its longest name that has a floor decides."""
    while module:
        for depth, names in enumerate(FLOORS):
            if module in names:
                return depth
        module = module.rpartition(".")[0]
    raise AssertionError("no floor")


def upward(root):
    return [str(one) for one in imports_of(root) if floor(one.imported) < floor(one.importer)]


def robots_in_the_engine(root):
    return [
        str(one)
        for one in imports_of(root)
        if one.importer.partition(".")[0] == "nlp" and one.imported.partition(".")[0] != "nlp"
    ]


def circle(root):
    """Return the modules of one circle of imports, or nothing."""
    graph = {}
    for one in imports_of(root):
        if one.runs:
            graph.setdefault(one.importer, set()).add(one.imported)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1][::-1]
    return []


def rooms(root):
    """Packages at the top, and what lies directly in formulations/."""
    inside = (root / "formulations").iterdir()
    names = {path.name for path in inside if path.is_dir() or path.suffix == ".py"}
    return {"nlp", "lockedjoint", *names} - {"__pycache__"}


def unknown_rooms(root):
    """Children of formulations/ without a floor of their own."""
    ground = len(FLOORS) - 1
    return [
        name
        for name in modules_of(root)
        if name.startswith("formulations.") and floor(name) == ground
    ]


def test_imports_go_down_only():
    found = upward(ROOT)
    assert not found, "\n".join(found)


def test_the_engine_knows_nothing_of_robots():
    found = robots_in_the_engine(ROOT)
    assert not found, "\n".join(found)


def test_no_circle_between_modules():
    found = circle(ROOT)
    assert not found, " -> ".join(found)


def test_every_room_has_its_floor():
    assert unknown_rooms(ROOT) == []


def test_there_are_few_rooms():
    assert len(rooms(ROOT)) <= ROOMS


def test_there_are_few_modules():
    assert len(modules_of(ROOT)) <= MODULES


# The rules notice what is planted -----------------------------------------------------------


def planted(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        for package in path.relative_to(root).parents[:-1]:
            (root / package / "__init__.py").touch()
    return root


SOLVING = "formulations/solving/start.py"
MEASURE = "formulations/measures/assessment.py"


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("from formulations.solving.start import f", "formulations.solving.start"),
        ("from formulations.solving import start", "formulations.solving.start"),
        ("from formulations import solving", "formulations.solving"),
        ("import formulations.solving.start as s", "formulations.solving.start"),
        ("from ..solving import start", "formulations.solving.start"),
        ("def f():\n    from formulations.solving import start", "formulations.solving.start"),
        (
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"
            "    from formulations.solving.start import f",
            "formulations.solving.start",
        ),
        ("import numpy\nfrom nlp import arrays\nfrom formulations.joints import arm", None),
    ],
)
def test_an_upward_import_is_seen(tmp_path, text, seen):
    below = {"nlp/arrays.py": "", "formulations/joints/arm.py": ""}
    root = planted(tmp_path, {SOLVING: "f = 1", MEASURE: text, **below})
    line = len(text.splitlines())
    assert upward(root) == ([f"{MEASURE}:{line} imports {seen}"] if seen else [])


def test_a_robot_in_the_engine_is_seen(tmp_path):
    root = planted(tmp_path, {MEASURE: "", "nlp/task.py": f"import {dotted(MEASURE)}"})
    assert robots_in_the_engine(root) == [f"nlp/task.py:1 imports {dotted(MEASURE)}"]


@pytest.mark.parametrize("runs", [True, False])
def test_a_circle_is_seen_unless_it_is_for_type_checking(tmp_path, runs):
    first, second = "formulations/joints/arm.py", "formulations/joints/joint.py"
    back = f"    from {dotted(first)} import f"
    condition = "def g():" if runs else "if TYPE_CHECKING:"
    files = {first: f"from {dotted(second)} import g", second: f"{condition}\n{back}"}
    found = circle(planted(tmp_path, files))
    assert set(found) == ({dotted(first), dotted(second)} if runs else set())


def test_a_room_without_a_floor_is_seen(tmp_path):
    root = planted(tmp_path, {MEASURE: "", "formulations/helpers/many.py": ""})
    assert set(unknown_rooms(root)) == {"formulations.helpers", "formulations.helpers.many"}
    assert rooms(root) == {"nlp", "lockedjoint", "__init__.py", "measures", "helpers"}


def dotted(file):
    return file.removesuffix(".py").replace("/", ".")
