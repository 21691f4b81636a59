"""Tables of a study say what its records say, in every format."""

import csv
import io
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from click.testing import CliRunner

from lockedjoint.commands.app import app
from lockedjoint.formulations import measures
from lockedjoint.formulations.campaign.campaign import declaration, run
from lockedjoint.formulations.campaign.records import COLUMNS, open_store
from lockedjoint.formulations.campaign.tables import frame, grouped, optima, read_campaign
from lockedjoint.nlp.errors import InputError

PLANAR = {"starts": 12, "models": ["free"], "joints": [3, 4], "task_dimensions": [2]}
PLANAR |= {"formulations": ["residual", "max-min"]}
PLANAR |= {"encodings": ["shared-factor", "factor-per-deletion"]}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("show") / "study.db"
    with open_store(path, writable=True) as store, ThreadPoolExecutor(1) as one:
        run(declaration(PLANAR), store, one)
    return path


def show(path, *arguments):
    done = CliRunner().invoke(app, ["show", str(path), *map(str, arguments)])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.output


def by_hand(path, **settings):
    with open_store(path) as store:
        rows = [{**r, **json.loads(r["cell"])} for r in store.frame().to_dict("records")]
    return [row for row in rows if all(row[k] == v for k, v in settings.items())]


def test_groups_count_what_the_records_say(path):
    with open_store(path) as store:
        table = grouped(store)
    assert len(table) == 2 + 4
    assert "encoding" in table
    assert "options" not in table, "they differ between formulations only"
    for line in table.to_dict("records"):
        rows = by_hand(path, **{k: line[k] for k in ("formulation", "joints", "encoding")})
        problem = by_hand(path, formulation=line["formulation"], joints=line["joints"])
        pick = min if line["formulation"] == "residual" else max
        best = pick(row["score"] for row in problem)
        reached = sum(abs(row["score"] - best) <= 1e-6 for row in rows)
        seconds = sum(row["cpu_seconds"] for row in rows)
        assert line["starts"] == len(rows) == 12
        assert line["cpu_seconds_per_start"] == pytest.approx(seconds / 12)
        assert line["reached_best"] == reached
        assert line["solved"] == sum(row["status"] == "Solve_Succeeded" for row in rows)
        assert line["score"] == pick(row["score"] for row in rows)
        assert line["iterations_median"] == np.median([row["iterations"] for row in rows])
        each = seconds / reached if reached else np.nan
        assert line["cpu_seconds_per_success"] == pytest.approx(each, nan_ok=True)


@pytest.mark.parametrize(
    "fault", [{"status": "Maximum_Iterations_Exceeded"}, {"violation": 1e-3}, {"valid": 0}]
)
def test_what_does_not_pass_the_gate_is_never_the_best(path, tmp_path, fault):
    """A score that looks better, of a start that did not converge or is not feasible."""
    kept = by_hand(path, formulation="max-min", encoding="shared-factor")[0]
    values = {k: v for k, v in kept.items() if k in COLUMNS}
    better = {**values, **fault, "score": values["score"] + 1.0}
    with open_store(tmp_path / "s.db", writable=True) as store:
        store.add(kept["cell"], [(0, values), (1, better)], "v")
        [line] = grouped(store).to_dict("records")
        found = optima(store)
    assert (line["starts"], line["reached_best"], line["score"]) == (2, 1, values["score"])
    assert found["score"].tolist() == [values["score"]]


def test_groups_of_several_problems_have_no_best(path):
    with open_store(path) as store:
        table = grouped(store, by=["formulation"])
        assert table["score"].isna().all()
        assert list(table["starts"]) == [24, 48]
        with pytest.raises(InputError, match="group is score"):
            grouped(store, by=["score"])


def test_the_regular_simplex_is_the_only_optimum_of_planar_3r(path):
    table = json.loads(show(path, "--rows", "optima", "--where", "joints == 3", "--json"))
    best = [line for line in table if line["level"] == 1]
    assert [line["formulation"] for line in best] == ["residual", "max-min"]
    for line in best:
        form = np.array(line["canonical_form"])
        assert line["classes"] == 1
        assert measures.worst_case_sigma(form) == pytest.approx(np.sqrt(0.5), abs=1e-6)
    assert best[0]["reached"] == best[0]["of_starts"] == 12
    assert 12 <= best[1]["reached"] <= best[1]["of_starts"] <= 24


def test_csv_keeps_every_digit(path):
    read = csv.DictReader(io.StringIO(show(path, "--rows", "records", "--to", "csv")))
    for line, row in zip(read, by_hand(path), strict=True):
        jacobian = np.array(json.loads(line["jacobian"]))
        assert jacobian.astype("<f8").tobytes() == row["jacobian"]
        assert float(line["score"]) == row["score"]


def test_json_has_native_types_and_every_digit(path):
    lines = json.loads(show(path, "--rows", "records", "--json"))
    for line, row in zip(lines, by_hand(path), strict=True):
        assert np.array(line["jacobian"]).astype("<f8").tobytes() == row["jacobian"]
        assert line["score"] == row["score"]
        assert line["valid"] is (row["valid"] == 1)
        assert isinstance(line["options"], dict)
        assert isinstance(line["earlier"], list)
    groups = json.loads(show(path, "--json"))
    assert all(type(group["valid"]) is int for group in groups)


@pytest.mark.parametrize(
    ("text", "starts"),
    [
        ("start >= 10", {10, 11}),
        ("start != 3 and not failures > 1", set(range(12)) - {3}),
        ("joints == 4.5", set()),
        ("model == 'free' and failures == 1", set(range(12))),
    ],
)
def test_conditions_compare_columns_with_values(path, text, starts):
    with open_store(path) as store:
        assert set(frame(store, text, ["score"])["start"]) == starts


def test_columns_bounds_and_one_call_from_python(path):
    table = read_campaign(path)
    best = table[(table["formulation"] == "max-min") & (table["joints"] == 3)].iloc[0]
    assert best["bound"] == pytest.approx(np.sqrt(1 / 2), abs=1e-15)  # eq. (6), attained
    assert 0 <= best["gap_percent"] < 1e-6
    names = ["joints", "score", "bound"]
    few = read_campaign(path, columns=names)
    assert few.equals(table[names])
    shown = show(path, "--columns", "joints, score,bound", "--to", "csv")
    assert shown == few.to_csv(index=False)
    with pytest.raises(InputError, match="column is nothing"):
        read_campaign(path, columns=["nothing"])
