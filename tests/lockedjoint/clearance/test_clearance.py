"""Capsules around links, their distances, and postures that keep links apart."""

import sys
from dataclasses import replace
from functools import lru_cache

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.clearance.around_shapes import capsule_around
from lockedjoint.clearance.distances import distance
from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.clearance.read_clearance import Obstacles, read_clearance
from lockedjoint.clearance.shapes import Shape
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.geometry import segment_distance
from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.kinematics.tree import RobotError
from lockedjoint.nlp.errors import InputError
from lockedjoint.robots.pose_constrained_arm import PoseConstrainedArm
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.search import Search
from tests.made_robots import in_pinocchio, pose_in_pinocchio, real


@lru_cache
def panda():
    declared = real("Franka")
    arm = declared.arm()
    return declared, arm, read_clearance(declared.path, arm.chain, 0.02)


def sampled(arm, count, seed=0):
    rng = np.random.default_rng(seed)
    return np.stack([arm.sample(rng) for _ in range(count)], axis=1)


def write(made, path, geometry):
    """A planar arm of four links of 0.4, along x, that all have this geometry."""
    text = made.planar_urdf([0.4] * 4, 'lower="-2.9" upper="2.9" effort="1" velocity="1"')
    for k in range(1, 5):
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{geometry}</link>')
    path.write_text(text)
    return RobotArm(chain_between(read_robot(path), "tip"), TaskSpace(("vx", "vy")))


BAR = """<collision><origin xyz="0.2 0 0" rpy="0 1.5707963267948966 0"/><geometry>
<cylinder radius="0.03" length="0.3"/></geometry></collision>"""


@pytest.fixture
def bars(made, tmp_path):
    """The arm of bars, and its file."""
    path = tmp_path / "bars.urdf"
    return write(made, path, BAR), path


def from_segment(points, capsule):
    along = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ along / max(along @ along, 1e-12), 0, 1)
    return np.linalg.norm(points - capsule.start - share[:, None] * along, axis=1)


def test_capsules_contain_the_meshes():
    shapes = [(link, shape) for link in panda()[2].links for shape in link.shapes]
    for link, shape in shapes:
        if shape.kind == "mesh":
            mesh = coal.MeshLoader().load(str(shape.file), np.ones(3))
            pose = link.pose @ shape.pose
            points = np.array(mesh.vertices()).reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
            farthest = np.max(from_segment(points, link.capsule))
            # And no larger than need be.
            assert link.capsule.radius - 0.01 <= farthest <= link.capsule.radius


@pytest.mark.parametrize(
    ("kind", "size"), [("box", (0.3, 0.1, 0.2)), ("cylinder", (0.1, 0.4)), ("sphere", (0.2,))]
)
def test_capsules_contain_the_simple_shapes(kind, size):
    """Points of coal's own solid, by its support in random directions."""
    pose = np.eye(4)
    pose[:3, 3] = 0.1, -0.2, 0.05
    shape = Shape(kind, size, None, pose)
    capsule = capsule_around((shape,), np.eye(4))
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.3, 0.3, (20000, 3))
    round_z, height = np.hypot(*points.T[:2]), np.abs(points[:, 2])
    inside = {
        "box": np.all(np.abs(points) <= np.resize(size, 3) / 2, axis=1),
        "sphere": np.linalg.norm(points, axis=1) <= size[0],
        "cylinder": (round_z <= size[0]) & (height <= size[-1] / 2),
    }
    points = points[inside[kind]] + pose[:3, 3]
    assert len(points) > 100
    farthest = np.max(from_segment(points, capsule))
    assert 0.9 * capsule.radius < farthest <= capsule.radius


def test_distances_of_segments_are_those_of_coals_capsules():
    """Parallel and crossing ones among them."""
    rng = np.random.default_rng(1)
    a, b, c, d = rng.normal(size=(4, 300, 3))
    d[:50] = c[:50] + (b - a)[:50] * rng.uniform(-2, 2, (50, 1))  # parallel
    d[50:60] = c[50:60]  # a point
    ours = segment_distance(*(one[:, :, None] for one in (a, b, c, d)), axis=1)[:, 0]
    for k in range(300):
        theirs = by_coal(_capsule(a[k], b[k]), _capsule(c[k], d[k]))
        assert theirs + 0.002 == pytest.approx(ours[k], abs=1e-4)


def _capsule(start, end):
    """With a radius of 1 mm."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), end - start).matrix()
    length = max(float(np.linalg.norm(end - start)), 1e-9)
    return coal.Capsule(0.001, length), pin.SE3(turn, (start + end) / 2)


def by_coal(*placed):
    """The distance of two solids, each with its place as pinocchio has it."""
    ends = ((solid, coal.Transform3s(at.rotation, at.translation)) for solid, at in placed)
    asked, found = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(*next(ends), *next(ends), asked, found)


def placed(found, link, q):
    """Where a link is at a configuration, as a matrix."""
    rotations, origins = found.frames(q[:, None])
    body = np.eye(4)
    body[:3, :3], body[:3, 3] = rotations[link.body][..., 0], origins[link.body][:, 0]
    return body @ link.pose


def test_links_are_where_pinocchio_has_them():
    """The least distance of the same pairs, by pinocchio's own geometry model."""
    declared, arm, found = panda()
    model = pin.buildModelFromUrdf(str(declared.path))
    folders = [str(declared.path.parents[k]) for k in range(6)]
    geometry = pin.buildGeomFromUrdf(
        model, str(declared.path), pin.GeometryType.COLLISION, package_dirs=folders
    )
    pairs = {frozenset(found.names(pair)) for pair in found.pairs}
    objects = geometry.geometryObjects
    for i in range(len(objects)):
        for j in range(i):
            names = {model.frames[one.parentFrame].name for one in (objects[i], objects[j])}
            if frozenset(names) in pairs:
                geometry.addCollisionPair(pin.CollisionPair(j, i))
    data, places = model.createData(), geometry.createData()
    for point in sampled(arm, 6).T:
        q, _ = in_pinocchio(model, arm.chain.names, point)
        pin.computeDistances(model, data, geometry, places, q)
        theirs = min(one.min_distance for one in places.distanceResults)
        ours = found.closest(point, found.pairs)
        assert max(ours.distance, 0) == pytest.approx(max(theirs, 0), abs=1e-6)
        assert np.min(found.distances(point[:, None])) <= max(ours.distance, 0) + 1e-9


def test_shapes_that_are_turned_and_shifted_are_where_pinocchio_has_them(made, tmp_path):
    """Through joints that turn, slide and stay, each with an origin of its own."""
    turns = ("0.4 0.7 0.2", "-0.3 1.1 0.5", "0.9 -0.6 2.0", "0.2 0.3 -1.4", "-1.0 0.4 0.6")
    kinds = ("revolute", "prismatic", "fixed", "revolute", "revolute")
    joints = [
        made.joint(f"j{k}", f"l{k}", f"l{k + 1}", kind, "0.1 -0.2 0.3", turn, "0.6 0 0.8")
        for k, (kind, turn) in enumerate(zip(kinds, turns, strict=True))
    ]
    text, rng = made.urdf(joints), np.random.default_rng(2)
    inertia = '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    solids = ('<box size="0.1 0.02 0.05"/>', '<cylinder radius="0.02" length="0.1"/>')
    for k in range(6):
        content = f"<inertial>{inertia}</inertial>"
        for solid in solids:
            x, y, z, roll, pitch, yaw = rng.uniform(-1, 1, 6)
            origin = f'<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/>'
            content += f"<collision>{origin}<geometry>{solid}</geometry></collision>"
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{content}</link>')
    path = tmp_path / "turned.urdf"
    path.write_text(text)
    chain = chain_between(read_robot(path), "l5")
    found = read_clearance(path, chain, 0.001)
    model = pin.buildModelFromUrdf(str(path))
    geometry = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION)
    data, places = model.createData(), geometry.createData()
    for q in rng.uniform(-1, 1, (5, 4)):
        assert list(model.names)[1:] == list(chain.names)
        pin.updateGeometryPlacements(model, data, geometry, places, q)
        theirs = {}
        for one, place in zip(geometry.geometryObjects, places.oMg, strict=True):
            theirs.setdefault(one.name[:2], []).append(place.homogeneous)
        assert len(found.links) == 6
        for link in found.links:
            ours = [placed(found, link, q) @ shape.pose for shape in link.shapes]
            np.testing.assert_allclose(ours, theirs[link.name], atol=1e-12)


def test_conditions_are_necessary_and_what_pinocchio_measures():
    """At postures that keep the distance all hold; the points are where pinocchio has them."""
    declared, arm, found = panda()
    points = sampled(arm, 200)
    near = points[:, ~found.is_kept(points)]
    assert near.shape[1] > 3
    conditions = [pair for q in near.T for pair in found.violated(q)]
    conditioned = replace(found, conditions=tuple(conditions))
    symbols = ca.SX.sym("q", 7)
    stated = ca.Function("shares", [symbols], [conditioned.shares(symbols)])
    kept = points[:, found.is_kept(points)]
    assert kept.shape[1] > 3
    assert min(float(ca.mmin(stated(q))) for q in kept.T) >= 1 - 3e-4  # the margin
    model = pin.buildModelFromUrdf(str(declared.path))
    theirs = pose_in_pinocchio(model, arm.chain.names, near[:, 0], "panda_hand")
    [hand] = [link for link in found.links if link.name == "panda_hand"]
    ours = placed(found, hand, near[:, 0])
    np.testing.assert_allclose(ours, theirs.homogeneous, atol=1e-12)
    least = found.closest(near[:, 0], found.pairs).distance
    share = float(ca.mmin(stated(near[:, 0])))
    assert share * (found.least + 1e-5) ** 2 == pytest.approx(max(least, 0) ** 2, abs=1e-9)


def test_neighbours_and_what_always_touches_are_left_out(made, tmp_path):
    _, _, found = panda()
    names = {frozenset(found.names(pair)) for pair in found.pairs}
    assert {"panda_link0", "panda_link1"} not in names
    assert {"panda_link7", "panda_hand"} not in names  # one body
    assert {"panda_link0", "panda_hand"} in names
    assert found.left_out == ()
    assert found.nearer == {}
    declared, arm, _ = panda()
    wide = read_clearance(declared.path, arm.chain, 0.03)  # more than a wrist can have
    ((k, least),) = wide.nearer.items()
    assert wide.names(wide.pairs[k]) == ("panda_link5", "panda_link7")
    assert 0.005 < least < 0.015
    points = sampled(arm, 40)
    distances = [wide.closest(q, [wide.pairs[k]]).distance for q in points.T]
    assert not np.any(wide.is_kept(points)[np.array(distances) < least])

    # Of these balls two are 0.8 apart at most.
    ball = '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    arm = write(made, tmp_path / "balls.urdf", ball)
    balls = read_clearance(tmp_path / "balls.urdf", arm.chain, 0.01)
    names = [balls.names(pair) for pair in balls.left_out]
    assert names == [("l1", "l3"), ("l2", "l4")]
    assert [balls.names(pair) for pair in balls.pairs] == [("l1", "l4")]


def test_links_keep_the_distance_that_is_asked_for(made, bars):
    """A planar arm that folds otherwise; the distance costs something, and is used up."""
    arm, path = bars
    pose = Pose((0.25, 0.1, 0.0))
    free = best_posture(arm, Search(starts=16), at=pose)
    point = np.array(list(free.assessment.q.values()))
    loose = read_clearance(path, arm.chain, 0.01)
    asked = 0.17
    assert loose.closest(point, loose.pairs).distance < asked
    clearance = read_clearance(path, arm.chain, asked)
    kept = best_posture(arm, Search(starts=16), at=pose, clearance=clearance)
    assert asked <= kept.clearance.closest.distance <= asked + 1e-4
    assert kept.assessment.worst_case_sigma < free.assessment.worst_case_sigma - 1e-3
    assert kept.at.position_error < 1e-6
    held = PoseConstrainedArm(arm.chain, arm.task, None, pose)
    points = held.configurations
    left = [made.sigmas_left(arm.jacobian(q)) for q in points[:, clearance.is_kept(points)].T]
    assert np.max(np.min(left, axis=1)) <= kept.assessment.worst_case_sigma + 1e-6


def test_what_no_posture_keeps_is_refused_with_the_best_seen(bars):
    arm, path = bars
    with pytest.raises(RobotError, match=r"is 3 m; .* l1 and l\d are 0.\d+ m apart"):
        best_posture(arm, Search(starts=1), clearance=read_clearance(path, arm.chain, 3.0))


COLLISION = "<collision><geometry>{}</geometry></collision>".format
VISUAL = '<visual><geometry><mesh filename="{}"/></geometry></visual>'.format
GEOMETRY = [
    ("two links that are not adjacent", ""),
    ("<collision> of link l1 is without geometry", COLLISION("")),
    ("is <cone>; allowed: one box", COLLISION("<cone/>")),
    ("sizes above 0", COLLISION('<capsule radius="0" length="1"/>')),
    ("sizes above 0", COLLISION('<sphere radius="-1"/>')),
    ("one number", COLLISION('<sphere radius="x"/>')),
    ("the attribute 'radius'", COLLISION("<sphere/>")),
    ("l1 is package://a/b.stl; allowed: a file beside the URDF", VISUAL("package://a/b.stl")),
    ("that ends in .stl, .obj, .dae, .ply", VISUAL("arm.urdf")),
    ("none.stl; allowed: a mesh that can be read", VISUAL("none.stl")),
]


@pytest.mark.parametrize(("sentence", "geometry"), GEOMETRY)
def test_geometry_that_is_none(made, tmp_path, sentence, geometry):
    path = tmp_path / "arm.urdf"
    (tmp_path / "none.stl").write_text("no mesh")
    arm = write(made, path, geometry)
    with pytest.raises(InputError, match=sentence):
        read_clearance(path, arm.chain, 0.01)


def test_without_coal_there_is_one_sentence(bars, monkeypatch):
    arm, path = bars
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(InputError, match=r"coal is missing: .*pip install"):
        read_clearance(path, arm.chain, 0.01)


CELL = """<robot name="cell"><link name="table"/><link name="wall"/><link name="post"/>
<joint name="a" type="fixed"><parent link="table"/><child link="wall"/>
<origin xyz="0.45 0 0.6" rpy="0.1 0.2 0.7"/></joint>
<joint name="b" type="fixed"><parent link="wall"/><child link="post"/>
<origin xyz="-0.2 -0.5 0.1" rpy="0 1 0"/></joint></robot>"""
SOLIDS = {"table": '<box size="1 1 0.1"/>', "wall": '<sphere radius="0.1"/>'}
SOLIDS |= {"post": '<cylinder radius="0.05" length="0.6"/>'}


def cell(path):
    text = CELL
    for name, solid in SOLIDS.items():
        shape = f"<collision><geometry>{solid}</geometry></collision>"
        text = text.replace(f'<link name="{name}"/>', f'<link name="{name}">{shape}</link>')
    path.write_text(text)
    down = np.eye(4)
    down[2, 3] = -0.1
    return Obstacles.read(path, down)


def test_obstacles_are_where_pinocchio_has_them(tmp_path):
    """And a bound of every distance, from boxes and capsules, is one of coal's."""
    declared, arm, alone = panda()
    path = tmp_path / "cell.urdf"
    found = read_clearance(declared.path, arm.chain, 0.02, cell(path))
    model = pin.buildModelFromUrdf(str(path))
    about = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION)
    places, down = about.createData(), pin.SE3(np.eye(3), np.array([0, 0, -0.1]))
    pin.updateGeometryPlacements(model, model.createData(), about, places, np.zeros(0))
    stands = {link.name: link for link in found.links if link.source == "obstacle"}
    assert set(stands) == set(SOLIDS)
    for one, spot in zip(about.geometryObjects, places.oMg, strict=True):
        link = stands[model.frames[one.parentFrame].name]
        assert link.body == 0
        ours = link.pose @ link.shapes[0].pose
        np.testing.assert_allclose(ours, (down * spot).homogeneous, atol=1e-12)
    between = [k for k, pair in enumerate(found.pairs) if pair not in alone.pairs]
    assert {name for k in between for name in found.names(found.pairs[k])} > set(SOLIDS)
    for point in sampled(arm, 12, seed=4).T:
        for k, bound in zip(between, found.distances(point[:, None])[between, 0], strict=True):
            distance = found.closest(point, [found.pairs[k]]).distance
            assert bound <= max(distance, 0) + 1e-9


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (0.1,), (0.1, 0.2)])
def test_a_solid_inside_a_mesh_is_noticed(size, tmp_path):
    """Of a shell that is no convex hull; coal alone sees two surfaces that do not meet."""
    trimesh = pytest.importorskip("trimesh", reason="install trimesh")
    outer = trimesh.creation.annulus(0.2, 1.0, 1.0)
    outer.export(tmp_path / "outer.stl")
    trimesh.creation.icosphere(radius=0.1).export(tmp_path / "inner.stl")
    kind = ("sphere", "cylinder", "mesh")[len(size) - 1]
    file = tmp_path / "inner.stl" if kind == "mesh" else None
    shell = Shape("mesh", (1.0, 1.0, 1.0), tmp_path / "outer.stl", np.eye(4))
    shapes = [shell, Shape(kind, size, file, np.eye(4))]

    def gap(x, enough=np.inf):
        place = coal.Transform3s(np.eye(3), np.array([x, 0.0, 0.0]))
        there = coal.Transform3s(np.eye(3), np.zeros(3))
        pair = (shapes[0], there), (shapes[1], place)
        return distance(*pair, enough)[0], distance(*reversed(pair), enough)[0]

    assert gap(0.0) == pytest.approx((0.1, 0.1), abs=2e-2)  # in the hole
    assert max(gap(0.6)) < 0  # in the material
    assert gap(1.5) == pytest.approx((0.4, 0.4), abs=2e-2)
    assert max(gap(0.95)) <= 0  # through the surface
    assert 0.2 <= min(gap(1.5, enough=0.2)) <= 0.41


def test_ways_that_are_clear_are_so_at_every_step(made, bars, tmp_path):
    """Against 400 steps of each way; a thin wall is not jumped over."""
    arm, path = bars
    wall = made.obstacle(tmp_path, "0.9 0.55 0", '<box size="0.3 0.002 0.3"/>')
    found = read_clearance(path, arm.chain, 0.01, wall)
    motion, ends = ClearMotion(found, arm.chain), sampled(arm, 120, seed=1)
    ends = ends[:, found.is_kept(ends)]
    starts, ends = ends[:, :-1], ends[:, 1:]
    ends = starts + 0.4 * (ends - starts)
    clear = motion.clear(starts, ends)
    touched = np.zeros(len(clear), dtype=bool)
    for share in np.linspace(0, 1, 400):
        points = starts + share * (ends - starts)
        touched |= np.min(found.gaps(points), axis=0) <= 0
    assert not np.any(clear & touched)
    assert np.mean(clear | touched) > 0.95  # and hardly one is refused without need
    assert min(np.sum(clear), np.sum(touched)) > 5
    over = np.array([[0.2, 0.9], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    assert found.is_kept(over).all()
    assert not motion.clear(over[:, :1], over[:, 1:])[0]


def test_the_nearest_links_on_a_way_are_those_of_many_points_of_it():
    """Of the Panda, on ways of all joints: no point between is nearer than is claimed."""
    _, arm, found = panda()
    motion = ClearMotion(found, arm.chain)
    way = sampled(arm, 3, seed=4).T
    nearest = motion.closest_along(way)
    shares = np.linspace(0, 1, 150)[:, None, None]
    points = (way[:-1] + shares * np.diff(way, axis=0)).reshape(-1, way.shape[1])
    least = motion.closest(points).distance
    assert nearest.at_least <= least + 1e-9
    assert nearest.distance <= least + 1e-3
    assert nearest.distance - nearest.at_least <= 1e-3 + 1e-9
    # The ends alone say less.
    assert motion.closest(way).distance > least
