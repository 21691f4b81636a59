"""``lockedjoint figure``, from its arguments to its files and messages."""

import csv
import json
import re
import sys
import zlib

import matplotlib.image
import pytest

from formulations.__main__ import main
from formulations.campaign.records import open_store
from formulations.plot import optima


@pytest.fixture
def lockedjoint(planar, monkeypatch, capsys):
    """Run the command line in this process, in a folder of its own."""
    monkeypatch.chdir(planar)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["lockedjoint", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return run


@pytest.fixture
def planar(tmp_path):
    (tmp_path / "j.csv").write_text("1,0.4,-0.5,0.2\n0,1,0.7,-0.6\n", encoding="utf-8")
    return tmp_path


def test_a_figure_its_data_and_its_json(lockedjoint, planar):
    status, out, err = lockedjoint(
        *("figure", "singular-values", "--jacobian", "j.csv", "--out", "new/f.pdf"),
        *("--data", "f.csv", "--json"),
    )
    assert (status, err) == (0, "")
    assert (planar / "new" / "f.pdf").read_bytes().startswith(b"%PDF")
    rows = json.loads(out)["rows"]
    with (planar / "f.csv").open(encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    assert [row["value"] for row in rows] == [float(row["value"]) for row in written]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("nonsense", "--out", "x.svg"), "one of figure-1, figure-3, seven-axes"),
        (("figure-1", "--out", "x.gif"), "ends in .svg, .png, .pdf"),
        (("figure-1",), "--out"),
        (("figure-1", "--out", "x.svg", "--size", "10"), "WIDTHxHEIGHT in cm, each 2 to 100"),
        (("figure-1", "--out", "x.svg", "--size", "1x1e9in"), "each 2 to 100"),
        (("singular-values", "--jacobian", "j.csv", "--out", "x.svg", "--size", "2x2"), "room"),
        (("figure-1", "--out", "x.svg", "--style", "none.mplstyle"), "--style"),
        (("figure-1", "--out", "x.svg", "--style", "."), "--style"),
        (("figure-1", "--out", "x.svg", "--jacobian", "j.csv"), "none with figure-1"),
        (("seven-axes", "--out", "x.svg", "--jacobian", "j.csv"), "6 rows"),
        (("seven-axes", "--out", "x.svg", "--pick", "1"), "none without --jacobian"),
        (("optima", "--out", "x.svg", "--store", "none.db"), "store"),
    ],
)
def test_what_is_not_allowed_is_one_sentence_and_no_file(
    lockedjoint, planar, arguments, sentence
):
    status, _, err = lockedjoint("figure", *arguments)
    assert status == 2
    assert sentence in err
    assert err.count("\n") == 1
    assert [path.name for path in planar.iterdir()] == ["j.csv"]


def test_a_missing_matplotlib_is_said(lockedjoint, planar, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    status, _, err = lockedjoint("figure", "trade-off", "--out", "x.svg")
    assert status == 2
    assert "pip install matplotlib" in err
    assert not (planar / "x.svg").exists()


def test_a_campaign_is_shown(lockedjoint, planar):
    (planar / "study.toml").write_text(
        'starts = 3\nformulations = ["residual", "max-min"]\nmodels = ["free"]\njoints = [4]\n'
        'task_dimensions = [3]\nencodings = ["shared-factor", "factor-per-deletion"]\n',
        encoding="utf-8",
    )
    run = ("campaign", "study.toml", "--store", "s.db", "--workers", "1")
    assert lockedjoint(*run)[0] == 0
    status, out, err = lockedjoint(
        *("figure", "optima", "--store", "s.db", "--out", "x.svg", "--json")
    )
    assert (status, err) == (0, "")
    problems = {row["problem"] for row in json.loads(out)["rows"]}
    assert len(problems) == 3
    assert "max-min, 4 × free encoding shared-factor" in problems
    assert "residual, 4 × free" in problems


def test_stored_starts_are_counted_by_the_gate(lockedjoint, planar):
    """As `Record.trusted`: acceptable answers count, those that violate a constraint do not."""
    (planar / "study.toml").write_text(
        'starts = 4\nformulations = ["residual"]\nmodels = ["free"]\njoints = [4]\n'
        "task_dimensions = [3]\n",
        encoding="utf-8",
    )
    assert lockedjoint("campaign", "study.toml", "--store", "s.db", "--workers", "1")[0] == 0
    assert optima.stored(planar / "s.db")["counted"].all()
    changes = (
        {"status": "Solved_To_Acceptable_Level"},
        {"status": "Maximum_Iterations_Exceeded"},
        {"violation": 1e-3},
        {"valid": 0},
    )
    with (
        open_store(planar / "s.db") as store,
        open_store(planar / "t.db", writable=True) as changed,
    ):
        rows = store.frame().to_dict("records")
        made = [{**row, **change} for row, change in zip(rows, changes, strict=True)]
        changed.add(rows[0]["cell"], list(enumerate(made)), rows[0]["environment"])
    table = optima.stored(planar / "t.db").set_index("start")
    assert table["counted"].to_dict() == {0: True, 1: False, 2: False, 3: False}


FROM_FILE = ("figure", "singular-values", "--jacobian", "j.csv", "--out")


def test_pdf_fonts_are_embedded_truetype(lockedjoint, planar):
    """Type 3 fonts are refused by publishers: fonts are embedded as TrueType instead."""
    (planar / "type3.mplstyle").write_text("pdf.fonttype: 3\n", encoding="utf-8")
    assert lockedjoint(*FROM_FILE, "f.pdf", "--style", "type3.mplstyle")[0] == 0
    plain = (planar / "f.pdf").read_bytes()
    for packed in re.findall(rb"stream\r?\n(.*?)endstream", plain, re.S):
        try:
            plain += zlib.decompress(packed)
        except zlib.error:
            continue
    assert b"/FontFile2" in plain
    assert not re.search(rb"/Subtype\s*/Type3", plain)


@pytest.mark.parametrize(("size", "pixels"), [("10x8", (787, 630)), ("5x4in", (1000, 800))])
def test_the_size_is_in_cm_or_inches(lockedjoint, planar, size, pixels):
    assert lockedjoint(*FROM_FILE, "f.png", "--size", size)[0] == 0
    height, width = matplotlib.image.imread(planar / "f.png").shape[:2]
    assert (width, height) == pytest.approx(pixels, abs=1)


def test_the_title_is_left_out_and_those_of_panels_stay(lockedjoint, planar):
    for more in ((), ("--no-title",)):
        assert (
            lockedjoint("figure", "figure-1", "--starts", "1", "--out", "f.svg", *more)[0] == 0
        )
        drawn = (planar / "f.svg").read_text(encoding="utf-8")
        assert ("whichever joint locks" in drawn) == (not more)
        assert "links 1." in drawn or "links 0." in drawn


def test_a_style_file_changes_looks(lockedjoint, planar):
    style = planar / "s.mplstyle"
    style.write_text(
        "xtick.labelcolor: ab12cd\naxes.prop_cycle: cycler('color', ['r', 'b'])\n",
        encoding="utf-8",
    )
    assert lockedjoint(*FROM_FILE, "f.svg", "--style", "s.mplstyle")[0] == 0
    assert "#ab12cd" in (planar / "f.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "line",
    [
        "axes.prop_cycle: cycler",
        "axes.titlesize: enormous",
        "font.size: 1e300",
    ],
)
def test_a_style_file_that_cannot_be_drawn_with_is_refused(lockedjoint, planar, line):
    (planar / "s.mplstyle").write_text(f"{line}\n", encoding="utf-8")
    status, _, err = lockedjoint(*FROM_FILE, "f.svg", "--style", "s.mplstyle")
    assert status == 2
    assert "--style" in err or "room for the panels" in err
    assert err.count("\n") == 1
    assert not (planar / "f.svg").exists()
