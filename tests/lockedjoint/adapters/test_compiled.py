"""The smooth worst case as machine code is that of NumPy, and tasks ask for it once."""

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.adapters import compiled

OFFSETS = ["0.1 0.05 0.3", "0 0.2 0.1", "0.1 0 0.3", "0 0.1 0.2", "0.3 0 0", "0 0.1 0", "0 0 1"]


@pytest.fixture(scope="module", params=["all", "position", "rail"])
def arm(request, made):
    kinds = {"j1": {"kind": "prismatic"}} if request.param == "rail" else {}
    text = made.urdf(made.serial(OFFSETS, **kinds))
    return made.arm(text, task="position" if request.param == "position" else "all")


@pytest.mark.parametrize("width", [0.001, 0.3])
def test_it_is_that_of_numpy(arm, width):
    smooth = compiled.smooth_of(arm, compiled=True)
    assert isinstance(smooth, compiled.Compiled)
    for point in arm.samples(np.random.default_rng(2), 200):
        value, slope = smooth(point, width)
        wanted, own = arm.smooth_worst_case(point, width)
        assert value == pytest.approx(float(wanted), abs=1e-11)
        assert slope == pytest.approx(own, abs=1e-8)


def test_many_equal_eigenvalues(made):
    """The page of C decomposes matrices with equal eigenvalues and with zeros, too."""
    arm = made.planar([1.0] * 6, task="vx,vy")
    smooth = compiled.smooth_of(arm, compiled=True)
    for q in (np.zeros(6), np.full(6, np.pi / 2), np.array([0, 1, 0, -1, 0, 1]) * np.pi / 2):
        value, slope = smooth(np.clip(q, -2, 2), 0.01)
        wanted, own = arm.smooth_worst_case(np.clip(q, -2, 2), 0.01)
        assert value == pytest.approx(float(wanted), abs=1e-11)
        assert slope == pytest.approx(own, abs=1e-8)


def test_what_is_no_configuration_is_refused(arm):
    smooth = compiled.smooth_of(arm, compiled=True)
    for wrong in (np.full(7, np.nan), np.full(7, np.inf), np.zeros(6), 0.3, "text"):
        with pytest.raises(lj.InputError, match="configuration is"):
            smooth(wrong, 0.01)


def test_without_a_compiler_it_is_numpys(arm, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("XDG_CACHE_HOME", "/nowhere")
    with pytest.warns(RuntimeWarning, match="Not compiled"):
        smooth = compiled.smooth_of(arm, compiled=True)
    point = arm.samples(np.random.default_rng(0), 1)[0]
    assert smooth(point, 0.01)[0] == float(arm.smooth_worst_case(point, 0.01)[0])


def test_the_function_of_a_robot(made, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(made.urdf(made.serial(OFFSETS)), encoding="utf-8")
    robot = lj.Robot(path)
    q = np.full(7, 0.4)
    smooth = compiled.smooth_worst_case(robot, 0.02)
    assert smooth(q)[0] == pytest.approx(
        float(robot.arm.smooth_worst_case(q, 0.02)[0]), abs=1e-12
    )
    with pytest.raises(lj.InputError, match="width is"):
        compiled.smooth_worst_case(robot, 0.0)


def test_error_and_jacobian_at_one_configuration_are_one_evaluation(arm, monkeypatch):
    asked = []

    def smooth(q, width):
        asked.append(q.copy())
        return 0.5, np.arange(7.0)

    monkeypatch.setattr(compiled, "smooth_of", lambda _, __: smooth)
    last = compiled.LastValue(arm, False, 0.01, range(1, 8), 9)
    here = np.zeros(7)
    for _ in range(3):
        value, row = last.at(here)
    assert (value, row.tolist(), len(asked)) == (0.5, [[0, 0, 1, 2, 3, 4, 5, 6, 0]], 1)
    here[3] = 0.1  # the same array, another configuration
    last.at(here)
    assert len(asked) == 2
