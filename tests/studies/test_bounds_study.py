"""The tables of bounds: one row per file, kept files with their own origin."""

import json
import shutil
from pathlib import Path

from formulations.io.provenance import read_header
from formulations.io.table import Table
from formulations.studies import bounds
from formulations.studies.bounds import (
    RUNS,
    BoundRow,
    Source,
    command,
    row_of,
    sharpest,
    study,
)
from formulations.studies.study import Effort

RESULTS = Path(__file__).parents[2] / "results" / "bounds"


def test_kept_files_keep_their_origin_and_others_say_that_it_is_unknown(tmp_path, monkeypatch):
    for name in ("residual_compact.json", "existence_order_2.json"):
        shutil.copy(RESULTS / name, tmp_path)
    plain = json.loads((RESULTS / "residual_compact.json").read_text(encoding="utf-8"))
    eight = {**plain, "joints": 8, "best_known": 0.0, "gap_percent": None, "size": None}
    (tmp_path / "eight.json").write_text(json.dumps(eight), encoding="utf-8")
    known = Source("residual_compact.json", "by hand", "version 0", "abacus", "1995-01-01")
    before = Table(BoundRow, [row_of(plain, known)])
    (tmp_path / "bounds.csv").write_text(before.csv(), encoding="utf-8")
    first = {"worst_case_7_6.json": RUNS["worst_case_7_6.json"]}
    monkeypatch.setattr(bounds, "RUNS", first)
    assert study().run(tmp_path, Effort(seed=3)).complete
    tables = study().read(tmp_path)
    rows = {row.file: row for row in tables["bounds"]}
    assert list(rows) == ["worst_case_7_6.json", "eight.json", "residual_compact.json"]
    assert (
        rows["worst_case_7_6.json"].command == "lockedjoint bound worst-case --trace 6 --json"
    )
    assert rows["worst_case_7_6.json"].machine not in ("", "not recorded")
    assert (rows["residual_compact.json"].machine, rows["residual_compact.json"].date) == (
        "abacus",
        "1995-01-01",
    )
    assert rows["eight.json"].machine == "not recorded"
    assert rows["eight.json"].command.endswith("--preset compact --joints 8 --json")
    assert rows["eight.json"].moments == 0
    [relaxation] = tables["relaxations"]
    assert relaxation.verdict == "feasible"
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert read_header(page)["seed"] == "3"
    assert "1995-01-01" in page
    assert "order 2 is feasible" in study().finding(tables)
    assert (
        sharpest(list(rows.values()), "residual", "numerical").file == "residual_compact.json"
    )
    assert sharpest(list(rows.values()), "residual", "rigorous") is None


def test_every_bound_is_on_record_and_its_command_names_it():
    for file in RUNS:
        plain = json.loads((RESULTS / file).read_text(encoding="utf-8"))
        words = command(plain)
        assert words.startswith("lockedjoint bound")
        assert ("--rigorous" in words) is file.endswith("_rigorous.json")
        assert str(plain.get("preset", plain.get("order", ""))) in words
