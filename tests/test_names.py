"""Names that nobody here chose, through every writer: they are data, wherever they arrive.

One list of names; each is the name of a joint of an arm, or a text in a table.
"""

import csv
import io
import json
import re
import subprocess
from dataclasses import dataclass
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import yaml
from markdown_it import MarkdownIt

import lockedjoint as lj
from lockedjoint.commands import output
from lockedjoint.commands.recover import _failures
from lockedjoint.commands.shared import Failures
from lockedjoint.commands.vocabulary import WORDS
from lockedjoint.figures.figures import plot
from lockedjoint.formulations.io import escaping
from lockedjoint.formulations.io.files import csv_text
from lockedjoint.formulations.io.table import Table
from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.kinematics.state import read_state
from lockedjoint.nlp.errors import printable
from lockedjoint.paths.plan import PathPlan, Trajectory
from lockedjoint.paths.timing import TimedTrajectory
from lockedjoint.paths.waypoints import Poses
from lockedjoint.robots.robot_assessment import measure_robot
from lockedjoint.robots.worst_case_code import worst_case_code
from lockedjoint.viewer.picture import numbers, picture
from lockedjoint.viewer.planned_path import PlannedPath
from tests.bad_names import NAMES, in_urdf

# Of ten joints each, because what takes time is one compilation for an arm.
ARMS = [tuple(NAMES[k : k + 10]) for k in range(0, len(NAMES), 10)]
MARKUP = MarkdownIt("commonmark").enable("table")
OURS = {"table", "thead", "tbody", "tr", "th", "td", "p", "strong"}


@dataclass(frozen=True)
class Line:
    """A row of a table with a text and a number."""

    text: str
    number: float


def robot_of(made, names) -> lj.Robot:
    lengths = [1 / (1 + k) for k in range(len(names))]
    text = in_urdf(made.planar_urdf(lengths), names)
    return lj.Robot(urdf_tree(xml_root(text.encode())), task="vx,vy")


@pytest.fixture(scope="module", params=ARMS, ids=range(len(ARMS)))
def robot(request, made):
    robot = robot_of(made, request.param)
    assert robot.arm.chain.names == request.param, "URDF has them as they are"
    return robot


@pytest.fixture(scope="module")
def named(robot):
    return robot.arm


class _Html(HTMLParser):
    """The tags and the text of HTML."""

    def __init__(self, content: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: set[str] = set()
        self.text = ""
        self.feed(content)
        self.close()

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.add(tag)
        assert {key for key, _ in attrs} <= {"style"}

    def handle_data(self, data) -> None:
        self.text += data

    def handle_comment(self, data) -> None:
        raise AssertionError(data)

    handle_decl = handle_pi = unknown_decl = handle_comment


def rendered(text):
    """The text that Markdown shows, if it has no other elements than ours."""
    page = _Html(MARKUP.render(text))
    assert page.tags <= OURS
    return page.text


@pytest.mark.compiler
def test_c_code_has_names_in_strings_only(named, tmp_path):
    code, header = worst_case_code(named, "mine")
    names = named.chain.names
    strings = {escaping.c_string(name) for name in names}
    assert all(
        one in code and re.fullmatch(r'"([\w.\- ]|\\[0-7]{3})*"', one) for one in strings
    )
    assert header.isascii()
    assert code.isascii()
    (tmp_path / "mine.c").write_text(code)
    (tmp_path / "mine.h").write_text(header)
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "mine.h"\nint main(void) {int k; '
        f'for (k = 0; k < {len(names)}; k++) printf("%s%c", mine_joints[k], 0); '
        "fputs(mine_arm, stdout); return 0;}\n"
    )
    flags = ["-std=c99", "-trigraphs", "-pedantic", "-Wall", "-Werror", "-Wno-unused"]
    words = ["cc", *flags, "-O0", "-o", "main", "main.c", "mine.c", "-lm"]
    subprocess.run(words, cwd=tmp_path, check=True, timeout=120)
    said = subprocess.run([tmp_path / "main"], capture_output=True, check=True, timeout=60)
    assert said.stdout.decode().split("\0") == [*names, named.description]


def test_jax_has_no_names(robot):
    pytest.importorskip("jax")
    from lockedjoint.adapters.jax import jacobian, jax

    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        program = str(jax.make_jaxpr(jacobian(robot))(np.zeros(robot.arm.size)))
    finally:  # other tests of this process have it as it was
        jax.config.update("jax_enable_x64", before)
    names = robot.arm.chain.names
    assert not any(printable(name) in program for name in names if len(name) > 5)


def test_pages_show_names_as_text(named):
    names, q = named.chain.names, named.chain.mid_range
    for locked in ((), names):
        shown = rendered(numbers(picture(named, q, locked), named))
        assert all(printable(name) in shown for name in locked)
    times, ends = np.arange(3.0), np.zeros((3, named.size), int)
    path = PlannedPath(named, times, np.zeros((3, named.size)), ends + np.arange(3)[:, None])
    said = rendered(path.words(0.0))
    assert all(printable(name) in said for name in names)
    assert printable(names[0]) in rendered(path.words(0.0, path.after(0, 0)))
    assert rendered(escaping.markdown(str(lj.InputError("joint", names[0], "x"))))


@pytest.mark.parametrize("names", ARMS, ids=range(len(ARMS)))
def test_html_of_a_robot_shows_names_as_text(made, names):
    shown = robot_of(made, names).changed(states={name: {} for name in names})._repr_html_()
    page = SvgTags(shown)
    assert page.tags <= OURS | {"svg", "polyline", "circle"}
    assert all(page.text.count(printable(name)) >= 2 for name in names)


class SvgTags(_Html):
    """The same, with a drawing's attributes."""

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.add(tag)
        assert tag in ("svg", "polyline", "circle") or not attrs


def test_html_of_notebooks_shows_names_as_text(named):
    shown = measure_robot(named, named.chain.mid_range)
    parsed = HtmlTags(shown._repr_html_())
    assert parsed.tags <= OURS


class HtmlTags(_Html):
    """The same, with the alignment of columns."""

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.add(tag)
        assert {key for key, _ in attrs} <= {"style"}


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_tables(name):
    """Markdown, LaTeX, CSV and terminal: of rows of ours and of a DataFrame, as of stores."""
    from lockedjoint.commands.campaign import _FORMATS

    table = Table(Line, [Line(name, 1.5)])
    frame = pd.DataFrame({name: [name], "number": [1.5]})
    for text in (table.markdown(), _FORMATS["markdown"](frame)):
        assert printable(name).strip() in rendered(text)
        assert len(text.strip().splitlines()) == 3
    for text in (table.latex(), _FORMATS["latex"](frame)):
        body = text.partition("\\midrule")[2].partition("\\bottomrule")[0]
        assert without_escapes(body).count("&") == 1
    for text in (table.csv(), _FORMATS["csv"](frame), csv_text([["x"], [name, 1.5]])):
        cell, number = list(csv.reader(io.StringIO(text, newline="")))[1]
        assert bare(cell) == bare(name)
        assert cell.lstrip()[:1] not in tuple("=+-@＝") or is_number(cell)
        assert not cell.startswith(("\t", "\r"))
        assert float(number) == 1.5
    assert "".join(output.fitted(table).splitlines()).isprintable()


def bare(name):
    """A name as CSV has it, without the mark of a text."""
    return printable(name, "\n\t").removeprefix("'")


def is_number(text):
    return re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", text)


def without_escapes(text):
    """LaTeX without what is written for special characters; none may be left.

    An asterisk or a bracket that begins a row is in braces.
    """
    words = r"textasciitilde\{\}|textbackslash\{\}|ensuremath\{[<>]\}"
    known = rf"\\(\$|&|%|#|_|\{{|\}}|\^\{{\}}|{words}|\\)|\{{[\[*]\}}"
    left = re.sub(known, "", text)
    assert not set(left) & set("\\$%#_^~{}")
    return left


def made_plan(names) -> PathPlan:
    count, n = 4, len(names)
    ends = np.full((count, n), 3)
    ends[0] = 2
    way = Trajectory(np.zeros((count, n)), ends, np.ones(count))
    poses = Poses(np.zeros((count, 3)), np.repeat(np.eye(3)[None], count, 0), range(6))
    return PathPlan(
        joints=names,
        times=np.arange(4.0),
        places=np.arange(4.0),
        poses=poses,
        planned=way,
        minimum_norm=None,
        best_of_samples=100.0,
        joint_best_of_samples=np.ones(n),
        unrecoverable_until=np.full(n, -1),
        nodes=1,
        polished=False,
        deviation=0.0,
        speed=None,
    )


def test_trajectories(named):
    """CSV, JSON and ROS's YAML of a trajectory, and of the plan."""
    names = named.chain.names
    n = len(names)
    zeros = np.full((2, n), 1e-7)
    run = TimedTrajectory(
        names[0], names, np.arange(2.0), zeros, zeros, zeros, np.zeros((2, 7)), 0.5, 0.5, 0.0
    )
    files = run.files()
    ros = yaml.safe_load(files["trajectory.yaml"])
    assert ros["joint_names"] == list(names)
    assert ros["header"]["frame_id"] == names[0]
    assert ros["points"][0]["positions"] == [1e-7] * n
    assert json.loads(files["trajectory.json"])["joints"] == list(names)
    plan = made_plan(names)
    for text in (files["trajectory.csv"], csv_text(plan.csv_lines())):
        head = next(csv.reader(io.StringIO(text, newline="")))
        without = [one.removesuffix(" (rad or m)") for one in head[1 : n + 1]]
        assert list(map(bare, without)) == list(map(bare, names))
        assert not any(one.lstrip().startswith(("=", "+", "-", "@", "＝")) for one in head)
    assert json.loads(json.dumps(plan.to_dict()))["joints"][0]["joint"] == names[0]


def test_figures(made, tmp_path):
    """All names in one figure: a file takes its time for fonts, not for names."""
    names, arm = tuple(NAMES), robot_of(made, tuple(NAMES)).arm
    for figure in (plot(made_plan(names)), plot(measure_robot(arm, arm.chain.mid_range))):
        content = figure.save(tmp_path / "x.svg").read_bytes()
        words = " ".join(ElementTree.fromstring(content).itertext())
        assert all(printable(name)[:20].strip() in words for name in names)
        for kind in ("pdf", "png"):
            figure.save(tmp_path / f"x.{kind}")


def test_a_style_with_latex_does_not_make_names_latex(named, tmp_path):
    (tmp_path / "s.mplstyle").write_text("text.parse_math: True\n")
    plot(made_plan(named.chain.names), style=tmp_path / "s.mplstyle").save(tmp_path / "x.svg")
    axes = plot(made_plan(named.chain.names)).figure.axes[-1]
    assert not any(one.get_usetex() or one.get_parse_math() for one in axes.get_yticklabels())


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_urdf_and_terminal(name, capsys):
    output.say(f"joint {name}")
    assert capsys.readouterr().out.rstrip("\n").isprintable() or "\n" in name
    output.warn(name)
    assert capsys.readouterr().err.rstrip("\n").isprintable()
    robot = lj.realise(lj.optimal_jacobian(8))
    if not name.isprintable():
        with pytest.raises(lj.InputError, match="without control characters"):
            lj.urdf(robot, name)
        return
    assert urdf_tree(xml_root(lj.urdf(robot, name).encode())).name == name


def addressable(name):
    """Whether the command line has a name as the file has it: blanks around it are left out."""
    return name == name.strip()


def test_names_are_addressed(named) -> None:
    """On the command line, whatever they have in common with its syntax."""
    chain = named.chain
    names = tuple(filter(addressable, chain.names))
    values = dict(zip(chain.names, np.linspace(-1, 1, named.size).tolist(), strict=True))
    text = ",".join(f"{name}={value!r}" for name, value in values.items())
    if names == chain.names:
        assert read_state(text, chain)[0].tolist() == list(values.values())
    word = WORDS["limits"]
    ends = word.gather("--limits", [f"{name}=-1:{k}" for k, name in enumerate(names)])
    assert ends == {name: (-1.0, float(k)) for k, name in enumerate(names)}
    never = Failures(1, ",".join(f"{name}=0" for name in names[:2])).model(names)
    assert never is not None
    assert never.probabilities[:2] == (0, 0)
    assert min(never.probabilities[2:]) > 0
    places = WORDS["locked"].gather("--locked", [f"{name}=0.5" for name in names])
    assert places == dict.fromkeys(names, 0.5)
    standing = [name if "=" not in name else f"{name}=" for name in names]
    assert WORDS["locked"].gather("--locked", standing) == dict.fromkeys(names)
    assert _failures({}, [f"{names[0]}=-1:1"]) == [lj.ReducedRange(names[0], -1, 1)]
    assert _failures({}, [f"{names[0]}=free"]) == [lj.FreeSwinging(names[0])]


def test_the_commands(made, tmp_path, lockedjoint) -> None:
    """`codegen` and `measure` of a file with the worst names."""
    worst = NAMES[:2] + NAMES[8:10] + NAMES[23:25]
    text = in_urdf(made.planar_urdf([1.0, 0.7, 0.5, 0.4, 0.3, 0.2]), worst)
    (tmp_path / "arm.urdf").write_text(text)
    lockedjoint.json("codegen", "arm.urdf", "--task", "vx,vy", cwd=tmp_path)
    code = (tmp_path / "worst_case.c").read_text() + (tmp_path / "worst_case.h").read_text()
    code = re.sub(r'"[^"]*"', "", code)
    assert not any(word in code for word in ("int spliced", "int trigraph", "iframe"))
    for name in ("int", "a__b", "_a", "jac", "../x", "é", "main"):
        done = lockedjoint.here("codegen", "arm.urdf", "--name", name, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "name is" in done.stderr
    said = lockedjoint.here("measure", "arm.urdf", "--task", "vx,vy", cwd=tmp_path)
    assert said.returncode == 0
    assert "\x1b" not in said.stdout
