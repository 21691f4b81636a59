"""Failure-tolerant workspaces: closed form, grid and brute force agree; symmetries; search."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import lockedjoint as lj
from lockedjoint.clearance.read_clearance import read_clearance
from lockedjoint.commands.workspace import _text
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.serial_chain import (
    frames_of,
    from_first_joint,
    idle_joints,
    is_planar,
    link_lengths,
    physical_ranges,
    planar_chain,
    serial_chain,
)
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from lockedjoint.workspaces import workspace as module
from lockedjoint.workspaces import workspace_size
from lockedjoint.workspaces.best_limits import best_limits
from lockedjoint.workspaces.best_planar_limits import in_joints
from lockedjoint.workspaces.cylinder_grid import check_grid
from lockedjoint.workspaces.planar import Planar3R, closed_form
from lockedjoint.workspaces.pose_sets import PoseSets, within
from lockedjoint.workspaces.reachable_sets import ReachableSets
from lockedjoint.workspaces.voxel_surface import surface_of_voxels, voxels_at_surface
from lockedjoint.workspaces.workspace import measured, workspace
from lockedjoint.workspaces.workspace_size import verified

EQUAL = (1 / 3, 1 / 3, 1 / 3)
PUBLISHED = tuple((-x, x) for x in np.radians([20, 90, 90]))


def rotated_by(yaw):
    return Rotation.from_euler("z", yaw).as_matrix()


def in_degrees(*limits):
    return tuple(tuple(np.radians(ends).tolist()) for ends in limits)


ODD = ((0.4, 0.33, 0.27), in_degrees((-30, 15), (-50, 110), (20, 110)))
# Angles beyond a half turn either way.
WRAPPED = ((0.178, 0.329, 0.493), in_degrees((0, 285), (-145, 206), (-256, -246)))
ARMS = [Planar3R(EQUAL, PUBLISHED), Planar3R(*ODD), Planar3R(*WRAPPED)]


def shown(made, text):
    return serial_chain(chain_between(made.tree(text), f"l{text.count('<joint')}"))


def contains(arm, points):
    """Which points are in the workspace; x points midway between the limits of joint 1."""
    rho, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    low, high = arm.rings
    least, largest = arm._bearings(rho)
    starts, ends = arm._intervals(rho)
    before = np.any((starts <= bearing) & (bearing <= ends), axis=0)
    after = (least <= np.abs(bearing)) & (np.abs(bearing) <= largest)
    return before & after & (low <= rho) & (rho <= high)


def brute_force(arm, points, angles=60):
    """Which points are kept: all locked angles on a grid, the two-link arm that is left."""
    first, second, third = arm.lengths
    points = points @ rotated_by(np.mean(arm.limits[0]))[:2, :2].T
    after = np.ones(len(points), dtype=bool)
    for joint, (low, high) in enumerate(arm.limits):
        for angle in np.linspace(low, high, angles):
            after &= ring(*locked(arm.lengths, points, joint, angle)) >= 0
    # No failure: configurations on a grid that pass at most `near` from the circle of p.
    grids = np.meshgrid(*(np.linspace(*ends, 300) for ends in arm.limits[1:]))
    q2, q3 = (grid.ravel() for grid in grids)
    tip = first + second * np.exp(1j * q2) + third * np.exp(1j * (q2 + q3))
    before = []
    low, high = arm.limits[0]
    for place in points @ [1, 1j]:
        bearings = np.angle(place / tip[np.abs(np.abs(tip) - abs(place)) < 4e-3])
        before.append(np.any((bearings - low) % (2 * np.pi) <= high - low))
    return after & np.array(before)


def locked(links, points, joint, angle):
    """The links that are left with a joint locked, and from where to where they reach."""
    if joint == 0:
        return links[1:], points - links[0] * np.array([np.cos(angle), np.sin(angle)])
    one = abs(links[joint - 1] + links[joint] * np.exp(1j * angle))
    return [*links[: joint - 1], one, *links[joint + 1 :]], points


def ring(links, away):
    """How far inside of the ring that links reach; negative outside."""
    distance, longest = np.linalg.norm(away, axis=-1), max(links)
    nearest = max(2 * longest - sum(links), 0)
    return np.minimum(sum(links) - distance, distance - nearest if nearest else np.inf)


@pytest.mark.parametrize("arm", ARMS)
def test_the_closed_form_is_what_brute_force_finds(arm):
    points = np.random.default_rng(0).uniform(-1, 1, (200, 2))
    ours = contains(arm, points)
    shifts = 0.02 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    around = [contains(arm, points + shift) for shift in shifts]
    away = np.all(np.equal(around, ours), axis=0)  # from the boundary
    assert np.sum(ours & away) > 3
    assert np.sum(~ours & away) > 50
    assert np.array_equal(ours[away], brute_force(arm, points)[away])


@pytest.mark.parametrize("arm", ARMS)
def test_the_area_is_that_of_the_points(arm):
    x = (np.arange(150) + 0.5) / 75 - 1
    inside = contains(arm, np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2))
    assert arm.area() == pytest.approx(4 * inside.mean(), abs=1e-2)
    mirrored = tuple((-high, -low) for low, high in arm.limits)
    assert Planar3R(arm.lengths, mirrored).area() == pytest.approx(arm.area(), abs=1e-9)


def test_the_published_area():
    size, error = ARMS[0].area_with_error()
    assert size == pytest.approx(0.355811, abs=1.5e-6)
    assert error < 1e-5
    assert ARMS[0].area() == pytest.approx(size, abs=5e-5)


def test_the_grid_agrees_with_the_closed_form(monkeypatch):
    arm = planar_chain(EQUAL)
    exact = workspace(arm, PUBLISHED, 0.02, np.deg2rad(10))
    assert exact.to_dict()["method"] == "closed form"
    monkeypatch.setattr(module, "closed_form", lambda *_: None)
    grid = measured(exact.sets, PUBLISHED)
    assert abs(grid.size - exact.size) < max(grid.error, 0.02)
    assert grid.raw > exact.size  # over-estimates
    assert grid.passed[0] < 0.7 < 0.95 < grid.passed[2]
    assert grid.physical == pytest.approx(np.pi, rel=0.05)
    inside = contains(ARMS[0], grid.sets.centres(np.ones_like(grid.voxels)))
    missed = inside.reshape(grid.voxels.shape) & ~grid.voxels
    assert missed.sum() < 0.01 * inside.sum()
    assert "0.25  –" in _text(replace(grid, passed=(0.25, math.nan)))


def size_of(sets, limits):
    return sets.unit * (sets.before(limits) & sets.after(limits)).sum()


@pytest.fixture(scope="module")
def spatial(made):
    slider = {"kind": "prismatic", "limit": 'lower="-0.1" upper="0.15"'}
    offsets = ["0.1 0 0.2", "0 0.1 0.1", "0.2 0 0", "0 0 0.25", "0 0 0.2"]
    joints = made.serial(offsets, made.AXES[:5], j2=slider)
    end = made.joint("end", "l5", "l6", "fixed", xyz="0.1 0 0.1")
    return made.urdf([*joints, end])


def test_positions_are_those_of_the_chain(spatial, made):
    chain = chain_between(made.tree(spatial), "l6")
    arm, judge = serial_chain(chain), RobotArm(chain, TaskSpace(("vx", "vy", "vz")))
    q = np.random.default_rng(0).uniform(-0.1, 0.1, (4, 5))
    _, _, ours = from_first_joint(arm).forward(q.T, range(3))
    theirs = np.array([judge.metric_jacobian(point)[:3] for point in q])
    base = frames_of(arm)[0][:3, :3]
    assert base @ np.moveaxis(ours, 2, 0) == pytest.approx(theirs, abs=1e-12)


def test_the_reachable_set_holds_every_position_and_is_found_by_inverse_kinematics(
    spatial, made
):
    arm = shown(made, spatial)
    limits = tuple((0.8 * low, 0.5 * high) for low, high in physical_ranges(arm))
    sets = ReachableSets(arm, 0.04, np.deg2rad(20))
    low, high = np.transpose(limits)
    q = np.random.default_rng(0).uniform(low, high, (3000, 5))
    place = np.rint(from_first_joint(arm).tip_at(q.T)[0].T / 0.04).astype(int) - sets.corner
    voxels = sets.before(limits)
    assert voxels[tuple(place.T)].mean() > 0.99
    after = voxels & sets.after(limits)
    if after.any():
        assert verified(sets, limits, after, 50)[0].mean() > 0.3
    assert sets.slices[2][0] == pytest.approx(-0.1)
    assert np.diff(sets.slices[2]).max() <= 0.08 + 1e-12


def test_a_voxel_that_is_too_small_is_refused_with_the_least(made):
    """Just above the least named, the grid can be made; with it, it cannot."""
    planar, seven = planar_chain((0.25,) * 4), shown(made, made.offset_arm())
    sets = lambda edge: PoseSets(planar, np.eye(3), edge)  # noqa: E731
    grid = lambda edge: check_grid(seven, edge, 0.1)  # noqa: E731
    for make in (sets, grid):
        with pytest.raises(InputError, match=r"allowed: above [0-9.]+: .*the grid has") as said:
            make(1e-4)
        least = float(re.search("above ([0-9.]+)", str(said.value))[1])
        with pytest.raises(InputError):
            make(0.99 * least)
    assert len(grid(1.01 * least)) == 7


def planar_urdf(made, lengths, axes=("0 0 1",) * 3, yaw="0"):
    places = ["0 0 0", *(f"{length} 0 0.05" for length in lengths)]
    how = {"kind": "continuous", "rpy": f"0 0 {yaw}"}
    joints = made.serial(places[:-1], axes, **{f"j{k}": how for k in range(len(axes))})
    tip = made.joint("end", f"l{len(lengths)}", "tip", "fixed", xyz=places[-1])
    return made.urdf([*joints, tip])


@pytest.mark.parametrize("axes", [("0 0 1",) * 3, ("0 0 1", "0 0 -1", "0 0 1")])
@pytest.mark.parametrize("yaw", ["0", "0.7"])
def test_a_planar_arm_is_recognised_however_it_is_described(made, axes, yaw):
    chain = chain_between(made.tree(planar_urdf(made, ODD[0], axes, yaw=yaw)), "tip")
    arm = serial_chain(chain)
    assert is_planar(arm)
    form = closed_form(arm, physical_ranges(arm))
    assert form.lengths == pytest.approx(ODD[0])
    back = closed_form(arm, in_joints(arm, ARMS[1]))
    assert back.area() == pytest.approx(ARMS[1].area(), rel=1e-9)


def test_a_joint_on_whose_axis_the_tip_is_does_not_count(made):
    offsets = ["0 0 0.3", "0.1 0 0.2", "0.2 0 0.2", "0.2 0 0.1", "0 0 0.1"]
    arm = shown(made, made.urdf(made.serial(offsets, made.AXES[:5])))
    assert idle_joints(arm) == (False, False, False, False, True)
    sets = ReachableSets(arm, 0.05, np.deg2rad(30))
    assert 4 not in sets.slices


def test_the_search_in_closed_form():
    arm = planar_chain(EQUAL)
    same, limits = best_limits(arm, 0.02, generations=1)
    other, both = best_limits(arm, 0.02, generations=1, lengths=True)
    assert same is arm
    for chosen, ends in ((arm, limits), (other, both)):
        assert closed_form(chosen, ends).area() > ARMS[0].area()
    assert link_lengths(other).sum() == pytest.approx(1)
    assert min(high - low for low, high in both) > np.deg2rad(9.99)
    module.check_limits(other, both)


def test_the_best_limits_of_three_equal_links():
    """0.395792 is the best of a scan over h1 and h2 = h3, with 1500 rings."""
    limits = best_limits(planar_chain(EQUAL), 0.02, generations=8)[1]
    area = closed_form(planar_chain(EQUAL), limits).area(1500)
    assert area == pytest.approx(0.395792, abs=5e-6)


@pytest.mark.parametrize("count", [3, 4])
def test_limits_about_a_posture_keep_its_voxel(count):
    arm = planar_chain((1 / count,) * count)
    sets = ReachableSets(arm, 0.05) if count == 3 else PoseSets(arm, np.eye(3), 0.15)
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(40):
        configuration, voxel = sets.draw(rng)
        if (limits := sets.around(configuration, voxel)) is None:
            continue
        inside += 1
        assert sets.after(limits).ravel()[voxel]
        wider = [(low - np.deg2rad(6), high + np.deg2rad(6)) for low, high in limits]
        for joint, (low, high) in enumerate(wider):
            if high - low < 2 * np.pi:
                at = (*limits[:joint], (low, high), *limits[joint + 1 :])
                assert not sets.after(at).ravel()[voxel]
    assert inside > 10


def test_the_search_begins_where_something_is_kept(made):
    """Random intervals alone keep no voxel of this grid, and a plateau has no way up."""
    arm = serial_chain(chain_between(made.tree(made.offset_arm()), "l7"))
    sets = PoseSets(arm, np.eye(3), 0.5, np.deg2rad(20))
    nothing = measured(sets, physical_ranges(arm))
    assert (nothing.size, nothing.error) == (0, pytest.approx(3 * sets.unit))
    assert measured(sets, best_limits(arm, 0.5, sets=sets, starts=1)[1]).size > 0


def test_the_search_on_a_grid():
    arm = planar_chain((0.25,) * 4)
    _, limits = best_limits(arm, 0.05, starts=1)
    longer, both = best_limits(arm, 0.05, starts=1, lengths=True)
    assert link_lengths(longer).sum() == pytest.approx(1)
    size = size_of(ReachableSets(arm, 0.03), limits)
    assert 0.5 < size < size_of(ReachableSets(longer, 0.03), both)
    with pytest.raises(InputError, match="least width is 4"):
        best_limits(arm, 0.05, least_width=4)


COARSE = ("--effort=voxel=0.05", "--effort=slice_degrees=20")


def test_workspace_of_a_file(lockedjoint, made, tmp_path):
    (tmp_path / "arm.urdf").write_text(planar_urdf(made, (0.3333333333333333,) * 3))
    pairs = enumerate(np.array(PUBLISHED).tolist())
    ends = [f"--limits=j{k}={low!r}:{high!r}" for k, (low, high) in pairs]
    files = [f"--out=a.{ending}" for ending in ("json", "svg", "npz", "ply")]
    done = lockedjoint.here("workspace", "arm.urdf", *ends, *COARSE, *files, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "0.35581" in done.stdout
    written = json.loads((tmp_path / "a.json").read_text())
    assert written["limits"]["j1"] == pytest.approx([-np.pi / 2, np.pi / 2])
    assert "kept after any failure" in (tmp_path / "a.svg").read_text()
    with np.load(tmp_path / "a.npz") as file:
        kept = dict(file)
    assert len(kept["points"]) * 0.05**2 == pytest.approx(written["raw"])
    # In the base's frame the arm's middle is along x, at the height of its tip.
    assert np.abs(kept["points"][:, 1].mean()) < 0.05
    assert kept["points"][:, 2] == pytest.approx(0.15)
    mesh = trimesh.load_mesh(tmp_path / "a.ply")
    assert mesh.volume == pytest.approx(0.05 * written["raw"], rel=1e-5)
    assert mesh.center_mass == pytest.approx(kept["points"].mean(axis=0), abs=1e-5)


def test_nothing_kept_makes_no_files(lockedjoint, made, tmp_path):
    (tmp_path / "arm.urdf").write_text(planar_urdf(made, (0.5, 0.3, 0.2)))
    done = lockedjoint.here("workspace", "arm.urdf", *COARSE, "--out=a.ply", cwd=tmp_path)
    assert (done.returncode, "a.ply was not written" in done.stderr) == (1, True)
    assert not (tmp_path / "a.ply").exists()


def test_the_surface_of_any_voxels_encloses_them():
    voxels = np.random.default_rng(0).random((4, 3, 5)) < 0.4
    corners, faces = surface_of_voxels(voxels)
    mesh = trimesh.Trimesh(corners, faces, process=False)
    assert mesh.volume == pytest.approx(voxels.sum())
    assert mesh.center_mass == pytest.approx(np.argwhere(voxels).mean(axis=0) + 0.5)
    assert mesh.area == pytest.approx(
        sum(np.abs(np.diff(np.pad(voxels, 1).astype(int), axis=k)).sum() for k in range(3))
    )


@pytest.mark.parametrize(
    ("lengths", "voxel", "degrees"),
    [
        ((0.3, 0.28, 0.24, 0.18), 0.14, 20),
        pytest.param((0.3, 0.24, 0.2, 0.16, 0.1), 0.34, 45, marks=pytest.mark.slow),
    ],
)
def test_a_planar_arm_that_holds_its_orientation(lengths, voxel, degrees):
    """What is reached after each failure is a ring of the links left, for every angle."""
    arm, angle = planar_chain(lengths), 0.4
    sets = PoseSets(arm, rotated_by(angle), voxel, np.deg2rad(degrees))
    *links, last = lengths
    x = sets._points[:, :2].reshape(*sets.shape, 2)
    wrist = x - last * np.array([np.cos(angle), np.sin(angle)])
    wrong = count = 0
    for joint, places in sets.slices.items():
        for place, theta in enumerate(places):
            ours = sets._unpacked(sets._reached[joint][place])
            if joint == len(links):  # from the tool's end
                margin = ring(*locked(links[::-1], wrist, 0, angle - theta))
            else:
                margin = ring(*locked(links, wrist, joint, theta))
            clear = np.abs(margin) > 0.01
            wrong += np.sum(ours[clear] != (margin > 0)[clear])
            count += clear.sum()
            assert not np.any(ours & (margin < -1e-3))  # nothing is counted that is not there
    assert wrong < 0.005 * count  # curves that were missed
    reached, disc = sets.before(physical_ranges(arm)), np.linalg.norm(wrist, axis=-1)
    assert reached[disc < sum(links) - 0.02].all()
    assert not reached[disc > sum(links) + 1e-4].any()
    if len(links) == 4:
        found = measured(sets, ((-1.0, 1.0), *((-2.2, 2.2),) * 4))
        assert 0 < found.size < found.physical


def test_size_and_limits_with_the_orientation_held():
    arm = planar_chain((0.25,) * 4)
    sets = PoseSets(arm, np.eye(3), 0.15)
    _, limits = best_limits(arm, 0.15, sets=sets, starts=1)
    result = measured(sets, limits)
    assert result.method == "self-motion"
    assert result.size == result.raw > 0
    assert result.error == pytest.approx(0.0225 * np.sqrt(voxels_at_surface(result.voxels)))
    error = 0.1 * np.sqrt(2 * np.pi * 7.5) * 0.1
    assert result.physical == pytest.approx(np.pi * 0.75**2, abs=error)
    assert result.passed[0] > 0.7


def test_curves_of_a_spatial_arm_hold_the_tool(made):
    """Every stored configuration puts the tool where it is held, by other kinematics."""
    offsets = ["0.1 0 0.2", "0 0.1 0.1", "0.2 0 0", "0 0 0.25", "0 0 0.2", "0.1 0 0", "0 0 0.1"]
    end = made.joint("end", "l7", "l8", "fixed", xyz="0.1 0 0.1", rpy="0.3 0 0.2")
    text = made.urdf([*made.serial(offsets, made.AXES[:7]), end])
    chain = chain_between(made.tree(text), "l8")
    arm = serial_chain(chain)
    wanted = Rotation.from_euler("xyz", [0.4, -0.3, 1.0]).as_matrix()
    sets = PoseSets(arm, wanted, 0.4)
    assert len(sets._q) > 100
    chosen = np.random.default_rng(0).integers(len(sets._q), size=50)
    q = sets._q[chosen].T.astype(float)
    origin, rotations = chain.tip_at(q)
    assert np.abs(rotations - wanted[..., None]).max() < 0.02
    base = frames_of(arm)[0]
    points = sets._points[sets._owners[chosen]] @ base[:3, :3].T + base[:3, 3]
    assert pytest.approx(points, abs=0.02) == origin.T
    lower, upper = np.transpose(physical_ranges(arm))
    assert np.all((sets._q >= lower - 1e-6) & (sets._q <= upper + 1e-6))


def test_configurations_in_collision_do_not_count(made, tmp_path, monkeypatch):
    """A wall out of reach changes nothing; one beside the arm does; one all over is refused."""
    pytest.importorskip("coal", reason="install coal")
    monkeypatch.setattr(workspace_size, "_SAMPLE_POINTS", 60)
    text = planar_urdf(made, (0.25,) * 4, ("0 0 1",) * 4)
    text = made.with_shapes(text, range(1, 5), '<sphere radius="0.01"/>')
    (tmp_path / "arm.urdf").write_text(text)
    chain = made.chain(text)
    arm = serial_chain(chain)
    sets = ReachableSets(arm, 0.1, np.radians(30))
    limits = in_degrees(*[(-40, 40)] * 4)
    free = measured(sets, limits)
    sizes = [free.size]
    assert free.collisions == "not checked"

    def among(place, box):
        obstacles = made.obstacle(tmp_path, place, f'<box size="{box}"/>')
        return read_clearance(tmp_path / "arm.urdf", chain, 0.001, obstacles)

    for place, box in (("3 0 0", "4 1 1"), ("0.5 0.2 0", "0.2 0.2 1")):
        sets.clearance = among(place, box)
        result = measured(sets, limits)
        assert result.to_dict()["collisions"] == "none in the size only"
        sizes.append(result.size)
    assert sizes[0] > 0
    assert sizes[1] == pytest.approx(sizes[0], rel=0.1)
    assert 0 < sizes[2] < sizes[0]
    with pytest.raises(InputError, match="obstacle thing is in contact with l1 wherever"):
        among("0 0 0", "4 4 1")


@pytest.mark.parametrize("seed", range(6))
def test_the_error_of_the_grid_contains_the_area_in_closed_form(seed, monkeypatch):
    """Of drawn arms and limits, at several resolutions."""
    rng = np.random.default_rng(seed)
    arm = planar_chain(tuple(rng.uniform(0.2, 0.6, 3)))
    area = 0.0
    while area < 1e-3:
        middle, half = rng.uniform(-2, 2, 3), rng.uniform(0.2, 0.8, 3)
        limits = tuple(zip((middle - half).tolist(), (middle + half).tolist(), strict=True))
        area, _ = module.closed_form(arm, limits).area_with_error()
    edge, step = (
        float(sum(link_lengths(arm))) / rng.choice([30, 50]),
        np.radians(rng.choice([5, 2])),
    )
    monkeypatch.setattr(module, "closed_form", lambda *_: None)
    found = workspace(arm, limits, edge, step)
    assert abs(found.size - area) <= found.error


@pytest.mark.parametrize("orientation", [None, (0.0, 0.0, 0.0)])
def test_the_seed_draws_other_points(made, orientation, monkeypatch):
    """The same seed gives the same; of other points the size differs within its error."""
    monkeypatch.setattr(workspace_size, "_SAMPLE_POINTS", 100)
    text = planar_urdf(made, (0.25,) * 4, ("0 0 1",) * 4)
    limits = {f"j{k}": (-0.7, 0.7) for k in range(4)}
    how = {"limits": limits, "orientation": orientation, "voxel": 0.1, "slice_degrees": 40.0}
    one, same, other = (
        lj.workspace(lj.Robot(made.tree(text)), seed=seed, **how) for seed in (0, 0, 7)
    )
    # With an orientation one point stands for a voxel, before a failure too.
    sizes = [
        found.size if orientation is None else found.before for found in (one, same, other)
    ]
    assert sizes[0] == sizes[1] > 0
    assert sizes[2] != sizes[0]
    if orientation is None:
        assert abs(other.size - one.size) < other.error + one.error


def test_positions_at_a_limit_are_within_it_some_turns_away_too():
    low, high = -0.4, 0.7
    q = np.array([low - 1e-9, low, high, high + 1e-9, 0.1, low - 1e-3, high + 1e-3])
    told = [True, True, True, True, True, False, False]
    assert within(q, low, high, continuous=False).tolist() == told
    for turns in (-2, 0, 3):
        assert within(q + 2 * np.pi * turns, low, high, continuous=True).tolist() == told
