"""The tables of bounds: one row per file, kept files with their own origin."""

import json
import shutil
from pathlib import Path

from formulations.files.provenance import read_header
from formulations.files.rows import read_rows
from formulations.studies.bounds.finding import sharpest
from formulations.studies.bounds.rows import BoundRow, ExistenceRow, Origin, command
from formulations.studies.bounds.runs import RUNS
from formulations.studies.bounds.study import study, write_tables

RESULTS = Path(__file__).parents[2] / "results" / "bounds"


def test_kept_files_keep_their_origin_and_others_say_that_it_is_unknown(tmp_path):
    for name in ("residual_compact.json", "existence_order_2.json", "worst_case_7_6.json"):
        shutil.copy(RESULTS / name, tmp_path)
    plain = json.loads((RESULTS / "residual_compact.json").read_text(encoding="utf-8"))
    eight = {**plain, "joints": 8, "best_known": 0.0, "gap_percent": None, "size": None}
    (tmp_path / "eight.json").write_text(json.dumps(eight), encoding="utf-8")
    known = Origin("by hand", "version 0", "abacus", "1995-01-01")
    write_tables(tmp_path, 3, {"residual_compact.json": known})
    rows = {row.file: row for row in read_rows(tmp_path / "bounds.csv", BoundRow)}
    assert list(rows) == ["worst_case_7_6.json", "residual_compact.json", "eight.json"]
    assert (rows["residual_compact.json"].machine, rows["residual_compact.json"].date) == (
        "abacus",
        "1995-01-01",
    )
    assert rows["eight.json"].machine == "not recorded"
    assert rows["eight.json"].command.endswith("--preset compact --joints 8 --json")
    assert rows["eight.json"].moments == 0
    [relaxation] = read_rows(tmp_path / "relaxations.csv", ExistenceRow)
    assert relaxation.verdict == "feasible"
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert read_header(page)["seed"] == "3"
    assert "1995-01-01" in page
    assert "order 2 is feasible" in study().finding(tmp_path)
    assert (
        sharpest(list(rows.values()), "residual", "numerical").file == "residual_compact.json"
    )
    assert sharpest(list(rows.values()), "residual", "rigorous") is None


def test_every_bound_is_on_record_and_its_command_names_it():
    for run in RUNS:
        plain = json.loads((RESULTS / run.file).read_text(encoding="utf-8"))
        words = command(plain)
        assert words.startswith("lockedjoint bound")
        assert ("--rigorous" in words) is run.file.endswith("_rigorous.json")
        assert str(plain.get("preset", plain.get("order", ""))) in words
