"""Tables of a study say what its records say, in every format."""

import csv
import io
import json
import sys
import tracemalloc

import numpy as np
import pandas as pd
import pytest
import typer.testing

from formulations import measures
from formulations.campaign import tables
from formulations.campaign.campaign import declaration, run
from formulations.campaign.records import SCHEMA
from formulations.campaign.tables import frame, grouped, optima
from formulations.commands.app import app
from formulations.commands.show import as_parquet
from nlp.errors import InputError, LockedJointError
from nlp.processes import Processes
from nlp.store import Store
from nlp.store_schema import condition

PLANAR = {
    "starts": 12,
    "formulations": ["residual", "max-min"],
    "models": ["free"],
    "joints": [3, 4],
    "task_dimensions": [2],
    "encodings": ["shared-factor", "factor-per-deletion"],
}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("show") / "study.db"
    with Store(path, SCHEMA, writable=True) as store:
        run(declaration(PLANAR), store, Processes(2))
    return path


def show(path, *arguments):
    done = typer.testing.CliRunner().invoke(app, ["show", str(path), *map(str, arguments)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.output


def by_hand(path, **settings):
    with Store(path, SCHEMA) as store:
        return [r for r in store.rows() if all(r[k] == v for k, v in settings.items())]


def test_groups_count_what_the_records_say(path):
    with Store(path, SCHEMA) as store:
        table = grouped(store)
    assert len(table) == 2 + 4
    assert "encoding" in table
    assert "options" not in table, "they differ between formulations only"
    for line in table.to_dict("records"):
        rows = by_hand(path, **{k: line[k] for k in ("formulation", "joints", "encoding")})
        problem = by_hand(path, formulation=line["formulation"], joints=line["joints"])
        pick = min if line["formulation"] == "residual" else max
        best = pick(row["merit"] for row in problem)
        reached = sum(abs(row["merit"] - best) <= 1e-6 for row in rows)
        seconds = sum(row["cpu_seconds"] for row in rows)
        assert line["starts"] == len(rows) == 12
        assert line["cpu_seconds_per_start"] == pytest.approx(seconds / 12)
        assert line["reached_best"] == reached
        assert line["solved"] == sum(row["status"] == "Solve_Succeeded" for row in rows)
        assert line["merit"] == pick(row["merit"] for row in rows)
        assert line["iterations_median"] == np.median([row["iterations"] for row in rows])
        if reached:
            assert line["cpu_seconds_per_success"] == pytest.approx(seconds / reached)
        else:
            assert np.isnan(line["cpu_seconds_per_success"])


def test_groups_of_answers_that_fail_the_check(path, tmp_path):
    """They have no merit, so no best; with better ones of the problem they never reach it."""
    kept = by_hand(path, formulation="residual")[0]
    values = {k: v for k, v in kept.items() if k in SCHEMA.values}
    failed = {**values, "merit": np.nan, "valid": 0, "status": "Restoration_Failed"}
    with Store(tmp_path / "s.db", SCHEMA, writable=True) as store:
        one, two = (
            store.cell({**{k: kept[k] for k in SCHEMA.settings}, "seed": seed})
            for seed in (0, 1)
        )
        made = [{**failed, "iterations": k, "cpu_seconds": 0.5} for k in (9, 4, 7)]
        store.add(one, list(enumerate(made)), "v")
        assert grouped(store)["merit"].isna().all()
        store.add(
            two, [(0, {**values, "merit": 2.0}), (1, {**values, "merit": 2.0 + 1e-7})], "v"
        )
        first, second = grouped(store).to_dict("records")
    assert (first["seed"], first["starts"], first["solved"], first["valid"]) == (0, 3, 0, 0)
    assert (first["iterations_median"], first["cpu_seconds_per_start"]) == (7, 0.5)
    assert first["reached_best"] == 0
    names = ("merit", "worst_case_sigma", "isotropy_defect", "cpu_seconds_per_success")
    assert np.isnan([first[name] for name in names]).all()
    assert (second["reached_best"], second["merit"]) == (2, 2.0)


@pytest.mark.parametrize(
    "fault", [{"status": "Maximum_Iterations_Exceeded"}, {"violation": 1e-3}, {"valid": 0}]
)
def test_what_does_not_pass_the_gate_is_never_the_best(path, tmp_path, fault):
    """A merit that looks better, of a start that did not converge or is not feasible."""
    kept = by_hand(path, formulation="max-min", encoding="shared-factor")[0]
    values = {k: v for k, v in kept.items() if k in SCHEMA.values}
    better = {**values, **fault, "merit": values["merit"] + 1.0}
    with Store(tmp_path / "s.db", SCHEMA, writable=True) as store:
        cell = store.cell({k: kept[k] for k in SCHEMA.settings})
        store.add(cell, [(0, values), (1, better)], "v")
        [line] = grouped(store).to_dict("records")
        found = optima(store)
    assert (line["starts"], line["reached_best"], line["merit"]) == (2, 1, values["merit"])
    assert found["merit"].tolist() == [values["merit"]]


def test_groups_of_several_problems_have_no_best(path):
    with Store(path, SCHEMA) as store:
        table = grouped(store, by=["formulation"])
        assert table["merit"].isna().all()
        assert list(table["starts"]) == [24, 48]
        with pytest.raises(InputError, match="group is merit"):
            grouped(store, by=["merit"])


def test_filters_choose_records(path):
    with Store(path, SCHEMA) as store:
        chosen = frame(store, [condition(SCHEMA, "joints=4"), condition(SCHEMA, "start<5")])
        assert (len(chosen), set(chosen["joints"])) == (15, {4})
        none = grouped(store, [condition(SCHEMA, "joints=9")])
        assert len(none) == 0
        assert "starts" in none
    assert "factor-per-deletion" not in show(path, "--where", "encoding=shared-factor")


def test_the_regular_simplex_is_the_only_optimum_of_planar_3r(path):
    table = json.loads(show(path, "--optima", "--where", "joints=3", "--json"))
    best = [line for line in table if line["level"] == 1]
    assert [line["formulation"] for line in best] == ["residual", "max-min"]
    for line in best:
        form = np.array(json.loads(line["canonical_form"]))
        assert line["classes"] == 1
        assert measures.worst_case_sigma(form) == pytest.approx(np.sqrt(0.5), abs=1e-6)
    assert best[0]["reached"] == best[0]["of_starts"] == 12
    assert 12 <= best[1]["reached"] <= best[1]["of_starts"] <= 24


def test_families_are_counted_and_listed_in_part(path, monkeypatch):
    monkeypatch.setattr(tables, "LISTED", 3)
    with Store(path, SCHEMA) as store:
        table = optima(store, [condition(SCHEMA, "joints=4")])
    first = table[(table["formulation"] == "residual") & (table["level"] == 1)]
    assert len(first) == 3
    assert set(first["classes"]) == {int(first["classes"].iloc[0])}
    assert first["classes"].iloc[0] > 3
    assert list(first["reached"]) == sorted(first["reached"], reverse=True)


def test_csv_and_parquet_keep_every_digit(path, tmp_path):
    read = list(csv.DictReader(io.StringIO(show(path, "--records", "--to", "csv"))))
    rows = by_hand(path)
    assert len(read) == len(rows)
    show(path, "--records", "--to", "parquet", "--out", tmp_path / "r.parquet")
    kept = pd.read_parquet(tmp_path / "r.parquet")
    for line, row, merit in zip(read, rows, kept["merit"], strict=True):
        jacobian = np.array(json.loads(line["jacobian"]))
        assert jacobian.astype("<f8").tobytes() == row["jacobian"]
        assert float(line["merit"]) == row["merit"] == merit


def test_markdown_and_latex_are_to_read(path, tmp_path):
    out = tmp_path / "new" / "table.tex"
    assert show(path, "--to", "latex", "--out", out) == ""
    latex = out.read_text()
    assert latex.startswith("\\begin{tabular}")
    assert "worst case sigma" in latex
    markdown = show(path)
    assert "0.70710678" in markdown
    assert len(markdown.splitlines()) == 2 + 6


def test_parquet_without_pyarrow_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install .*(pyarrow|parquet)"):
        as_parquet(pd.DataFrame({"a": [1]}))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--where", "nothing=1"), "one of formulation"),
        (("--where", "joints"), "COLUMN=VALUE"),
        (("--where", "joints=x"), "a whole number"),
        (("--where", "jacobian=1"), "numbers or text"),
        (("--group-by", "nothing"), "one of formulation"),
        (("--group-by", "formulation", "--optima"), "at most one of them"),
        (("--to", "excel"), "one of csv, parquet, markdown, latex"),
        (("--to", "parquet"), "a file, for parquet"),
    ],
)
def test_refuses_what_is_not_there(path, arguments, said):
    with pytest.raises(LockedJointError, match=said):
        show(path, *arguments)


def test_a_store_that_is_missing_is_not_made(lockedjoint, tmp_path):
    done = lockedjoint.here("show", tmp_path / "none.db", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("Error: store is")
    assert list(tmp_path.iterdir()) == []


def test_every_record_is_classified(tmp_path):
    """Also those after the first thousand: copies of a few answers, each many times."""
    with Store(tmp_path / "s.db", SCHEMA, writable=True) as store:
        run(declaration({**PLANAR, "starts": 3, "joints": [3]}), store, Processes(1))
        rows = list(store.rows([condition(SCHEMA, "formulation=residual")]))
        values = {k: v for k, v in rows[0].items() if k in SCHEMA.values}
        copies = [(k, values) for k in range(3, 2503)]
        store.add(1, copies, "copied")
        table = optima(store, [condition(SCHEMA, "formulation=residual")])
    assert list(table["reached"]) == [2503]
    assert list(table["of_starts"]) == [2503]


def test_tables_need_no_more_memory_for_more_records(tmp_path):
    used = []
    with Store(tmp_path / "s.db", SCHEMA, writable=True) as store:
        run(declaration({**PLANAR, "starts": 3, "joints": [3]}), store, Processes(1))
        values = {k: v for k, v in next(store.rows()).items() if k in SCHEMA.values}
        for first, last in ((3, 1500), (1500, 4500)):
            store.add(1, [(k, values) for k in range(first, last)], "copied")
            tracemalloc.start()
            table = grouped(store)
            levels = optima(store)
            used.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
            assert table["starts"].iloc[0] == levels["of_starts"].iloc[0] == last
    assert used[1] < 1.3 * used[0], "three times the records"
