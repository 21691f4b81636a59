"""What ended in an error of Python, or of another library: it has its sentence, or is done."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.clearance.meshes import mesh_file
from lockedjoint.formulations.io.files import write_text
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.nlp.solver import Solver
from tests.lockedjoint.clearance.test_meshes import SPHERE

IN_A_POOL = """
import multiprocessing
import lockedjoint as lj

def solved(_):
    return lj.solve("residual", lj.arm("unit-revolute", 8), starts=2).status_counts

if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(pool.map(solved, [0]))
"""


@pytest.mark.processes
def test_a_daemonic_process_solves_with_one_worker(tmp_path, lockedjoint):
    (tmp_path / "pool.py").write_text(IN_A_POOL)
    environment = lockedjoint.environment(PYTHONPATH=os.environ.get("PYTHONPATH", "."))
    how = {"capture_output": True, "text": True, "timeout": 300, "env": environment}
    done = subprocess.run([sys.executable, tmp_path / "pool.py"], **how)
    assert "Solve_Succeeded" in done.stdout, done.stderr


class OfAHandlerError(Exception):
    """What a handler of signals raises."""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="of POSIX")
def test_what_a_handler_of_signals_raises_is_passed_on():
    def raises(*_):
        raise OfAHandlerError

    from lockedjoint.formulations import max_min

    arm = lj.arm("unit-revolute", 12)
    problem = max_min.build(arm, encoding="factor-per-deletion")
    solver = Solver(problem, {"max_iter": 3000, "tol": 1e-14})
    start = arm.sample(np.random.default_rng(0))

    def solve_for_long():
        for _ in range(1000):
            solver.solve(start)

    before = signal.signal(signal.SIGALRM, raises)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(OfAHandlerError):
            solve_for_long()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_a_working_folder_that_is_gone(tmp_path, lockedjoint, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    code = "import os; os.rmdir(os.getcwd()); from pathlib import Path; "
    code += "from lockedjoint.formulations.io.files import prepare_file, write_text\n"
    for call in ('write_text(Path("x"), "y")', 'prepare_file(Path("x"))'):
        code += f"try:\n    {call}\nexcept ValueError as error:\n    print(error)\n"
    said = lockedjoint.python(code, cwd=gone)
    assert said.count("a path to write to") == 2


def test_names_that_no_file_can_have(tmp_path, lockedjoint, made):
    long = "a" * 5000
    for name in (f"{long}.stl", f"package://{long}/x.stl", "a\0.stl"):
        assert mesh_file(name, tmp_path / "arm.urdf") is None
    with pytest.raises(FileError):
        write_text(tmp_path / long, "x")
    text = made.planar_urdf([0.5] * 4)
    shape = f'<visual><geometry><mesh filename="{long}.stl"/></geometry></visual>'
    text = text.replace('<link name="l1"/>', f'<link name="l1">{shape}</link>')
    (tmp_path / "arm.urdf").write_text(
        text.replace('name="l3"/>', f'name="l3">{SPHERE(1)}</link>')
    )
    words = ("posture", "arm.urdf", "--task", "vx,vy", "--clearance", "0.1")
    done = lockedjoint.here(*words, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "standard output" not in done.stderr
    include = f'<mujoco><worldbody><include file="{long}"/></worldbody></mujoco>'
    (tmp_path / "arm.xml").write_text(include)
    with pytest.raises(InputError):
        lj.Robot(tmp_path / "arm.xml")


class Unshown:
    """A value whose own repr raises."""

    def __repr__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    "call",
    [
        lambda: lj.atlas(Unshown()),
        lambda: lj.atlas(5),
        lambda: lj.bound("max-min", Unshown()),
        lambda: lj.measure(Unshown()),
        lambda: lj.plot(Unshown()),
        lambda: lj.solve(starts=Unshown()),
    ],
)
def test_values_that_cannot_be_shown(call):
    with pytest.raises(InputError):
        call()


def test_no_joint_is_drawn_if_none_is_asked_for():
    rng = np.random.default_rng(0)
    for joint in (
        *(lj.LeverRevolute(), lj.LeverRevolute(budget="mean"), lj.UnitRevolute()),
        *(lj.FreeColumn(), lj.FreeColumn(budget="mean"), lj.Prismatic()),
    ):
        assert joint.sample(rng, 0).shape == (0, len(joint.parameters))


def test_more_failures_than_joints():
    assert lj.bound("max-min", lj.arm("unit-revolute", 7), 999).value == 0


def test_names_are_a_list(tmp_path):
    with (
        lj.open_store(tmp_path / "s.db", writable=True) as store,
        pytest.raises(InputError, match="a list of names"),
    ):
        lj.read_campaign(store, by="joints")
