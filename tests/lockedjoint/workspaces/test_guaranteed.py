"""Cubes that are kept for certain: against the closed form, solutions and false claims."""

import zipfile
from dataclasses import replace
from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from lockedjoint.kinematics.chain import ChainJoint
from lockedjoint.kinematics.geometry import homogeneous
from lockedjoint.kinematics.serial_chain import (
    chain_about_z,
    from_first_joint,
    physical_ranges,
    planar_chain,
)
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.workspaces import check_kept
from lockedjoint.workspaces.check_kept import check_cubes
from lockedjoint.workspaces.guaranteed import guaranteed_workspace
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.kept_proofs import REACHED, KeptProofs, Pairs
from lockedjoint.workspaces.planar import Planar3R
from tests.lockedjoint.workspaces.test_workspace import ARMS, contains

SCARA = chain_about_z(
    [
        ChainJoint("a", False, -3.0, 3.0),
        ChainJoint("b", False, -3.0, 3.0),
        ChainJoint("c", False, -2.5, 2.5),
        ChainJoint("d", True, -0.1, 0.3),
        ChainJoint("e", True, -0.2, 0.2),
    ],
    [np.eye(4) + along_x * np.eye(4, k=3) for along_x in (0.0, 0.4, 0.3, 0.0, 0.0)],
    np.eye(4) + 0.2 * np.eye(4, k=3),
)


def spatial():
    """An arm of five revolute joints with skew axes and a slider between them."""
    rng = np.random.default_rng(3)
    joints, frames = [], []
    for k in range(6):
        placement = np.eye(4)
        placement[:3, :3] = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        placement[:3, :3] *= np.linalg.det(placement[:3, :3])
        placement[:3, 3] = rng.uniform(-0.4, 0.4, 3)
        ends = (-0.3, 0.3) if k == 2 else (-2.6, 2.6)
        joints.append(ChainJoint(f"j{k}", k == 2, *ends))
        frames.append(placement)
    return chain_about_z(joints, frames, homogeneous(np.eye(3), rng.uniform(-0.3, 0.3, 3)))


def false_claims(exact, cubes):
    """Which plane cubes reach with a corner beyond what the closed form says is kept."""
    signs = np.array(list(product((-1, 1), repeat=2)))
    corners = cubes.centre[:, None] + cubes.half_width[:, None, None] * signs
    return ~contains(exact, corners.reshape(-1, 2)).reshape(-1, 4).all(axis=1)


def some_pairs(proofs, count, seed, width, half):
    """Pairs about configurations that are drawn, with each joint locked or none."""
    rng = np.random.default_rng(seed)
    joint = rng.integers(0, proofs.n + 1, count)
    ends = np.where(np.isfinite(proofs.lower[-1]), [proofs.lower[-1], proofs.upper[-1]], 3.0)
    q = rng.uniform(np.minimum(*ends), np.abs(ends[1]), (count, proofs.n))
    tips = from_first_joint(proofs.arm).tip_at(q.T)[0][proofs.rows].T
    middle = np.where(joint < proofs.n, q[np.arange(count), joint % proofs.n], 0.0)
    halves = np.where(joint < proofs.n, half, 0.0)
    cube = np.arange(count)
    return Pairs(cube, tips, np.full(count, width), joint, middle, halves, q)


@pytest.mark.parametrize("arm", [planar_chain((0.4, 0.3, 0.3)), SCARA, spatial()])
def test_where_the_test_holds_every_corner_has_a_solution_nearby(arm):
    proofs = KeptProofs(
        arm, tuple((0.9 * low, 0.9 * high) for low, high in physical_ranges(arm))
    )
    pairs = some_pairs(proofs, 300, 0, 0.01, 0.03)
    holds, _, _ = proofs.hold(pairs)
    assert holds.mean() > 0.2
    pairs = pairs[holds]
    m = len(proofs.rows)
    for corner in product((-1, 1), repeat=m + 1):
        there = replace(
            pairs,
            centre=pairs.centre + 0.01 * np.array(corner[:m]),
            middle=pairs.middle + corner[m] * pairs.half,
        )
        q, missing = proofs.reached(there, pairs.q.T)
        assert missing.max() < REACHED
        locked = pairs.joint < proofs.n
        here = q.T[np.flatnonzero(locked), pairs.joint[locked]]
        assert np.array_equal(here, there.middle[locked])


def test_it_does_not_hold_beyond_what_is_reachable_or_allowed():
    arm = planar_chain((0.4, 0.3, 0.3))
    proofs = KeptProofs(arm, ((-1.0, 1.0),) * 3)
    pairs = some_pairs(proofs, 200, 1, 1e-3, 1e-3)
    assert proofs.hold(pairs)[0].mean() > 0.5
    # A cube that is not where the configuration is; one that is larger than the arm.
    assert not proofs.hold(replace(pairs, centre=pairs.centre + 2.5))[0].any()
    assert not proofs.hold(replace(pairs, width=pairs.width * 1500))[0].any()
    assert not proofs.hold(replace(pairs, half=np.where(pairs.half, 4.0, 0.0)))[0][
        pairs.joint < 3
    ].any()
    # A configuration outside the limits that hold before a failure.
    before = replace(pairs, joint=np.full(len(pairs), 3), half=np.zeros(len(pairs)))
    outside = replace(before, q=before.q + [2.5, 0, 0])
    turned = from_first_joint(arm).tip_at(outside.q.T)[0][:2].T
    assert not proofs.hold(replace(outside, centre=turned))[0].any()


@pytest.fixture(scope="module")
def cubes(once):
    def make():
        exact = ARMS[0]
        parts = guaranteed_workspace(planar_chain(exact.lengths), exact.limits, 0.01, 2)
        return KeptCubes.joined(list(parts))

    return once("guaranteed planar cubes", make)


@pytest.mark.long
def test_cubes_of_a_planar_arm_lie_within_the_closed_form(cubes):
    exact: Planar3R = ARMS[0]
    assert 0.75 < cubes.size / exact.area() < 1
    assert not false_claims(exact, cubes).any()


def test_no_two_cubes_overlap(cubes):
    apart = np.abs(cubes.centre[:, None] - cubes.centre).max(axis=2)
    touching = cubes.half_width[:, None] + cubes.half_width
    assert np.all((apart > touching - 1e-12) | np.eye(len(cubes.half_width), dtype=bool))


def test_a_file_of_cubes_is_read_and_proved_again(cubes, tmp_path, lockedjoint):
    path = tmp_path / "kept.npz"
    few = cubes[np.arange(len(cubes.half_width)) % 27 == 0]
    path.write_bytes(few.to_bytes())
    again = KeptCubes.read(path)
    assert again.size == few.size
    assert again.limits == few.limits
    assert check_cubes(again).all()
    answer = lockedjoint.here("verify", path, cwd=tmp_path)
    assert (answer.returncode, f"proved: {few.size:.6g} m²" in answer.stdout) == (0, True)


def test_files_of_cubes_that_overlap_are_refused(tmp_path):
    arm, path = planar_chain((0.4, 0.3, 0.3)), tmp_path / "kept.npz"
    centre, width = np.array([[0.1, 0.1], [0.05, 0.05]]), np.array([0.1, 0.05])
    path.write_bytes(KeptCubes(arm, ((-1.0, 1.0),) * 3, centre, width).to_bytes())
    with pytest.raises(FileError, match="overlap"):
        KeptCubes.read(path)


@pytest.mark.long
def test_cubes_that_many_starts_missed_are_proved_again():
    """Of the Panda's, of 4 000 these are some that sixteen passes of few starts had left."""
    every = KeptCubes.read(Path(__file__).parents[3] / "results/guaranteed/franka-panda.npz")
    hard = np.isin(np.arange(len(every.half_width)), [11022, 34864, 114332, 129269, 137510])
    assert check_cubes(every[hard]).all()


@pytest.mark.long
def test_changed_claims_are_not_proved(cubes, monkeypatch):
    """Cubes that reach beyond what the closed form says is kept; wider limits; longer links."""
    # Two passes, whole and in parts: further ones try the same test from more starts.
    passes = (check_kept._Pass(0, 2), check_kept._Pass(1, 4))
    monkeypatch.setattr(check_kept, "_PASSES", passes)
    monkeypatch.setattr(check_kept, "_REPEATED_PASSES", 0)
    exact, rng = ARMS[0], np.random.default_rng(0)
    chosen = rng.choice(len(cubes.half_width), 9, replace=False)
    moved = replace(cubes, centre=cubes.centre[chosen], half_width=cubes.half_width[chosen])
    edges = 2 * moved.half_width[:, None]
    shift = edges * np.round(rng.uniform(-0.3, 0.3, moved.centre.shape) / edges)
    # Beside the grid a cube could reach beyond the one that is proved.
    with pytest.raises(InputError, match="one grid"):
        check_cubes(replace(moved, centre=moved.centre + shift + edges / 8))
    moved = replace(moved, centre=moved.centre + shift)
    false = false_claims(exact, moved)
    assert false.sum() > 4
    assert not check_cubes(moved)[false].any()
    wide = tuple((1.3 * low, 1.3 * high) for low, high in exact.limits)
    larger = replace(moved, centre=cubes.centre[chosen], limits=wide)
    false = false_claims(Planar3R(exact.lengths, wide), larger)
    assert not check_cubes(larger)[false].any()


@pytest.mark.parametrize(
    "change",
    [
        {"half_width": None},
        {"half_width": [-0.1]},
        {"centre": [[0.5, np.nan]]},
        {"centre": [[0.5, 0.1, 0.2, 0.3]]},
        {"limits": [[-0.3, 0.3]]},
        {"placement": np.full((3, 4, 4), 2.0)},
        {"tip": [0.3]},
        {"limits": [[-0.3, 0.3], [-9.0, 9.0], [-0.3, 0.3]]},
        {"centre": [[0.5, 0.1]] * 2, "half_width": [0.1] * 2},
        {"centre": [[0.5, 0.5], [1.3, 0.3]], "half_width": [0.5, 0.3]},
    ],
)
def test_damaged_files_are_refused(cubes, change, tmp_path):
    path = tmp_path / "kept.npz"
    with np.load(BytesIO(cubes[np.arange(len(cubes.half_width)) == 0].to_bytes())) as file:
        arrays = {name: file[name] for name in file.files} | change
    kept = {name: array for name, array in arrays.items() if array is not None}
    np.savez(path, **kept)
    with pytest.raises(FileError, match="cubes that"):
        KeptCubes.read(path)


def test_an_archive_of_no_arrays_is_refused(tmp_path):
    path = tmp_path / "kept.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("centre.npy", b"not an array")
    with pytest.raises(FileError, match="cubes that"):
        KeptCubes.read(path)


@pytest.mark.parametrize(
    ("first", "settings", "named"),
    [
        (1.0, (0.0,), "finest"),
        (1.0, (0.1, 13), "levels"),
        (-1.0, (0.1,), "artificial limits of joint_1"),
    ],
)
def test_bad_arguments_are_named(first, settings, named):
    limits = ((-first, first), (-1.0, 1.0), (-1.0, 1.0))
    with pytest.raises(InputError, match=named):
        next(guaranteed_workspace(planar_chain((0.4, 0.3, 0.3)), limits, *settings))


@pytest.mark.long
def test_the_command_proves_and_writes(lockedjoint, tmp_path):
    rows = ["# convention: standard", "kind,a,alpha_rad,d,theta_rad"]
    (tmp_path / "arm.csv").write_text("\n".join([*rows, *["revolute,0.3333,0,0,0"] * 3]))
    limits = [word for k in (2, 3) for word in ("--limits", f"joint_{k}=-1.9:1.9")]
    words = ["prove-workspace", "arm.csv", "--limits", "joint_1=-0.3:0.3", *limits]
    coarse = ["--effort=finest=0.05", "--effort=halvings=1", "--out", "kept.npz"]
    values = lockedjoint.json(*words, *coarse, "--out", "kept.svg", cwd=tmp_path)
    assert 0.1 < values["kept_for_certain"] < 0.396
    read = KeptCubes.read(tmp_path / "kept.npz")
    assert read.size == values["kept_for_certain"]
    assert "at least" in (tmp_path / "kept.svg").read_text("utf-8")
    again = lockedjoint.here("verify", "kept.npz", cwd=tmp_path)
    said = " ".join(again.stdout.split())
    assert (again.returncode, f"proved: {read.size:.6g} m²" in said) == (0, True)
    nothing = [*words[:2], "--effort=finest=0.2", "--effort=halvings=0"]
    none = lockedjoint.here(*nothing, cwd=tmp_path)
    assert (none.returncode, "Nothing was proved" in none.stderr) == (1, True)
