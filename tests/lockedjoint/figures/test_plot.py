"""`lj.plot` draws what the value says; short lines and tables of it in notebooks."""

from concurrent.futures import ThreadPoolExecutor

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib import rcParams

import lockedjoint as lj
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError, LockedJointError

MATRIX = np.array([[1.0, 0.4, -0.5, 0.2], [0.0, 1.0, 0.7, -0.6]])


@pytest.mark.parametrize("failures", [1, 2])
def test_bars_are_what_numpy_finds(failures):
    figure = lj.plot(lj.measure(MATRIX, failures=failures)).figure
    bars = figure.axes[0].patches
    labels = [text.get_text() for text in figure.axes[0].get_xticklabels()]
    for bar, label in zip(bars, labels, strict=True):
        rest = np.delete(MATRIX, [int(joint) for joint in label.split(",")], axis=1)
        assert bar.get_height() == pytest.approx(np.linalg.svd(rest)[1][-1])


def test_a_robot_at_a_configuration(tmp_path):
    (tmp_path / "arm.csv").write_text(
        "# convention: standard\nkind,a,d,alpha_rad,theta_rad\n" + 4 * "R,1,0,0,0\n",
        encoding="utf-8",
    )
    robot = lj.Robot(tmp_path / "arm.csv", task=TaskSpace(("vx", "vy")))
    found = lj.measure(robot, [0.1, 0.5, -0.7, 1.0])
    drawn = [bar.get_height() for bar in lj.plot(found).figure.axes[0].patches]
    assert drawn == [failure.sigma for failure in found.by_failure]


def test_a_plot_is_saved_as_asked(tmp_path):
    plot = lj.plot(lj.measure(MATRIX), size="5x4in", title=False)
    assert b"text{white-space: pre}" in plot.save(tmp_path / "a.svg").read_bytes()
    (tmp_path / "a.svg").unlink()
    assert plot.figure.axes[0].get_title("left") == ""
    assert tuple(plot.figure.get_size_inches()) == (5, 4)
    assert plot.save(tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(InputError, match=r"ends in \.svg"):
        plot.save(tmp_path / "a.gif")
    assert [one.name for one in tmp_path.iterdir()] == ["a.pdf"]


def test_a_plot_on_axes_of_a_user(tmp_path):
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3))
    measured = lj.measure(MATRIX)
    plot = lj.plot(measured, ax=right, title=False)
    assert plot.figure is figure
    assert not left.patches
    assert [bar.get_height() for bar in right.patches] == pytest.approx(measured.locked_sigmas)
    assert right.get_title("left") == ""
    assert plot.save(tmp_path / "a.svg").stat().st_size > 1000
    for wrong in ({"ax": right, "size": "5x4in"}, {"ax": left}):
        value = measured if "size" in wrong else lj.realise(lj.optimal_jacobian(8))
        with pytest.raises(InputError, match="ax is"):
            lj.plot(value, **wrong)
    plt.close(figure)


def test_an_outcome_of_nothing_has_no_figure():
    none = lj.solve("isotropy", "unit-revolute", 7, starts=1, workers=1)
    with pytest.raises(LockedJointError, match="No start passes"):
        lj.plot(none)


def test_figures_of_eight_threads_are_alike_and_leave_settings_alone():
    """Matplotlib's settings are the process's."""
    found, before = lj.measure(np.eye(2, 3)), dict(rcParams)
    with ThreadPoolExecutor(8) as pool:
        drawn = set(pool.map(lambda _: lj.plot(found)._repr_svg_(), range(24)))
    assert len(drawn) == 1
    assert dict(rcParams) == before
