"""Robots of public packages: what the table says is what the code does."""

from pathlib import Path

import numpy as np
import pytest

from lockedjoint.formulations.io.table import read_rows
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.read_robot import read_robot
from results.robots_public import robots_public
from results.robots_public.packages import PACKAGES
from results.robots_public.references import by_differences, by_pinocchio
from results.robots_public.robots_public import PublicRow, longest_chain, row_of

TABLE = Path(__file__).parents[2] / "results" / "robots_public" / "robots_public.csv"
ROWS = read_rows(TABLE, PublicRow)
HERE = next(package for package in PACKAGES if package.name == "example-robot-data")
PANDA = "panda_description/urdf/panda.urdf"


def test_no_jacobian_is_wrong():
    assert all(row.right for row in ROWS)
    assert robots_public.STUDY.complain(ROWS) == ""
    compared = [row for row in ROWS if row.by]
    assert len(compared) > 150
    assert {row.package for row in compared} == {package.name for package in PACKAGES}


def test_what_is_refused_is_refused_in_one_sentence():
    refused = [row for row in ROWS if row.verdict == "refused"]
    assert refused
    assert all("; allowed: " in row.note and "Traceback" not in row.note for row in refused)


@pytest.mark.parametrize("name", [PANDA, "ur_description/urdf/ur3.urdf"])
def test_a_row_is_what_the_code_computes(name):
    row = next(one for one in ROWS if (one.package, one.file) == (HERE.name, name))
    anew = row_of(HERE.name, name, HERE.path / name, Effort(seed=0, starts=1, workers=1))
    assert (anew.verdict, anew.tip, anew.joints, anew.note) == (
        row.verdict,
        row.tip,
        row.joints,
        row.note,
    )
    assert anew.mid_range_sigma == pytest.approx(row.mid_range_sigma, abs=1e-9, nan_ok=True)


def test_a_wrong_jacobian_would_be_seen():
    path = HERE.path / PANDA
    tree = read_robot(path)
    chain = longest_chain(tree)
    q = np.full(len(chain.names), 0.02)
    matrix = by_pinocchio(path, tree, chain, q)
    assert matrix == pytest.approx(by_differences(chain, q), abs=1e-7)
    assert matrix != pytest.approx(by_differences(chain, q + 0.01), abs=1e-3)
    assert robots_public._error([matrix], [matrix + 1e-3]) > robots_public.SAME_BY_DIFFERENCES
