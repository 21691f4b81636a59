"""Data are written before anything is drawn: a figure that fails costs no data."""

import json

import numpy as np
import pytest

from tests import made_robots as made


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(made.planar_urdf([0.5, 0.4, 0.3, 0.2]))
    wide = 'lower="-6.2" upper="6.2" effort="1" velocity="1"'
    turning = made.planar_urdf([1 / 3] * 3, wide)
    (tmp_path / "turning.urdf").write_text(turning)
    (tmp_path / "way.csv").write_text("x,y,z\n0.9,0.5,0\n0.8,0.6,0\n")
    return tmp_path


class FigureError(Exception):
    """What a library that draws may raise."""


def broken(*_, **__):
    raise FigureError


LIMITS = [
    *("--limits", "j0=-0.35:0.35"),
    *("--limits", "j1=-1.57:1.57"),
    *("--limits", "j2=-1.57:1.57"),
]
#: A command line, what draws, and the files of data that it writes.
COMMANDS = {
    "path": (
        "path arm.urdf way.csv --task vx,vy --effort samples=6 --effort tracks=4"
        " --effort rounds=0 --out-dir done --acceleration 1 --recoveries",
        "draw_path",
        ("done/path.csv", "done/path.json", "done/trajectory.csv", "done/recoveries.npz"),
    ),
    "workspace": (
        "workspace turning.urdf --effort voxel=0.1 --effort slice_degrees=40 --out a.svg"
        " --out a.json --out a.npz --out a.ply",
        "draw_workspace",
        ("a.json", "a.npz", "a.ply"),
    ),
    "prove-workspace": (
        "prove-workspace turning.urdf --effort finest=0.05 --effort halvings=1 --out a.svg"
        " --out a.npz",
        "draw_kept",
        ("a.npz",),
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_figure_that_fails_costs_no_data(name, folder, lockedjoint, monkeypatch):
    from lockedjoint.figures import robots

    line, drawn, files = COMMANDS[name]
    monkeypatch.setattr(robots, drawn, broken)
    words = line.split() + (LIMITS if name != "path" else [])
    with pytest.raises(FigureError):
        lockedjoint.here(*words, cwd=folder)
    for file in files:
        path = folder / file
        assert path.stat().st_size > 0, file
        if path.suffix == ".json":
            json.loads(path.read_text())
        if path.suffix == ".npz":
            assert np.load(path).files
    assert not list(folder.rglob("*.svg"))
