"""The page that shows a robot: its numbers against NumPy, its controls, and a real browser."""

import json
import os
import re
import shutil
import signal
import socket
import sys
import time
import urllib.request
from contextlib import closing
from itertools import product

import numpy as np
import pinocchio
import pytest
import trimesh
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from lockedjoint.nlp.errors import InputError, printable
from lockedjoint.paths.following import follow
from lockedjoint.paths.survival import survivors
from lockedjoint.paths.waypoints import Poses
from lockedjoint.robot import Robot
from lockedjoint.robots.search import Search
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.write_urdf import urdf as realised_urdf
from lockedjoint.viewer.address import Address
from lockedjoint.viewer.page import Page
from lockedjoint.viewer.picture import numbers, picture
from lockedjoint.viewer.planned_path import PlannedPath
from lockedjoint.viewer.view import view
from tests.bad_names import NAMES, in_urdf

BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
# Three dimensions without a graphics card.
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
SOFTWARE += ["--enable-unsafe-swiftshader"]


@pytest.fixture(scope="module")
def text(made):
    return made.offset_arm()


def configurations(arm, count=3):
    rng = np.random.default_rng(7)
    return [arm.sample(rng) for _ in range(count)]


def smallest(matrix):
    """Return the sixth singular value; 0 if there are fewer columns."""
    return np.linalg.svd(matrix)[1][-1] if matrix.shape[1] >= 6 else 0.0


@pytest.mark.parametrize("locked", [(), ("j0", "j5")])
def test_a_picture_against_numpy(made, text, locked):
    arm = made.arm(text)
    for q in configurations(arm):
        shown, matrix = picture(arm, q, locked), arm.jacobian(q)
        rest = np.delete(matrix, [int(name[1]) for name in locked], axis=1)
        assert shown.sigma == pytest.approx(smallest(matrix))
        assert shown.sigma_left == pytest.approx(smallest(rest))
        more = [np.delete(rest, k, axis=1) for k in range(rest.shape[1])]
        sigmas = [smallest(after) for after in more]
        assert shown.worst_case == pytest.approx(min(sigmas))
        if locked:
            assert shown.failed == locked
        else:
            assert shown.failed == (f"j{np.argmin(sigmas)}",) == (shown.worst_joint,)
            rest = more[int(np.argmin(sigmas))]
        # An ellipsoid {A·x : |x| ≤ 1} is that of A·Aᵀ.
        for axes, rates in ((shown.before, matrix), (shown.after, rest)):
            np.testing.assert_allclose(axes @ axes.T, rates[:3] @ rates[:3].T, atol=1e-12)
        assert np.linalg.norm(shown.direction) == pytest.approx(1)
        least = np.linalg.norm(rest.T @ shown.direction)
        assert least == pytest.approx(smallest(rest), abs=1e-12)


@pytest.mark.parametrize("slides", [False, True])
def test_joints_and_tip_are_where_pinocchio_has_them(made, text, slides):
    if slides:
        text = realised_urdf(realise(np.eye(6)[:, [0, 3, 1, 4, 2, 5, 3]]))
    arm = made.arm(text)
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    for q in configurations(arm):
        shown = picture(arm, q)
        pinocchio.framesForwardKinematics(model, data, q)
        tip = data.oMf[model.getFrameId(arm.chain.tip)]
        np.testing.assert_allclose(shown.tip, tip.translation, atol=1e-12)
        places = [data.oMi[k + 1].translation for k in range(len(q))]
        prismatic = np.array(arm.chain.prismatic)[:, None]
        moved = shown.origins + prismatic * shown.axes * q[:, None]
        np.testing.assert_allclose(moved, places, atol=1e-12)
        moves = np.cross(shown.axes, shown.tip - shown.origins)
        columns = np.where(prismatic, shown.axes, moves)
        np.testing.assert_allclose(columns.T, arm.metric_jacobian(q)[:3], atol=1e-12)


def test_a_failure_that_ends_a_direction_is_flat(made):
    arm = made.arm(made.spherical_shoulder_and_wrist())
    [q] = configurations(arm, 1)
    shown = picture(arm, q)
    assert shown.failed == ("j3",)
    assert shown.worst_case == pytest.approx(0, abs=1e-12)
    last = picture(arm, q, ["j1"])
    assert (last.worst_case, last.worst_joint) == (0.0, None)
    assert "no joint to spare" in numbers(last, arm)
    gone = picture(arm, q, arm.chain.names)
    assert gone.sigma_left == 0
    assert np.all(gone.after == 0)
    with pytest.raises(InputError, match="locked joint is j9; allowed: one of j0, j1"):
        picture(arm, q, ["j9"])
    with pytest.raises(InputError, match="configuration"):
        picture(arm, q[:3])


@pytest.fixture(scope="module")
def file(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def opened(file, task=None, **more):
    robot = Robot(file, task=task)
    how = Address(port=0).free(), Search(starts=2)
    return closing(Page(robot, robot.chain.mid_range, *how, **more))


@pytest.fixture
def page(file):
    with opened(file) as shown:
        yield shown


def test_sliders_locks_and_buttons_change_the_picture(page):
    assert page._server.request_share_url() is None, "no tunnel to the internet"
    before = page._numbers.content
    assert page.locked == ()
    page.move({"j1": 0.7, "j3": 99.0})
    moved = page._numbers.content
    assert moved != before
    np.testing.assert_allclose(page.positions, [0, 0.7, 0, 2.0, 0, 0, 0], atol=1e-12)
    for locked, said in ((True, "allowed"), (False, "Best posture found by")):
        page._locks["j2"].value = locked
        wanted = picture(page.arm, page.positions, ["j2"] * locked)
        assert page.draw().sigma_left == pytest.approx(wanted.sigma_left)
        assert f"{wanted.sigma_left:.4f}" in page._numbers.content
        page.seek()
        page.searching.join(60)
        assert said in page._status.content  # six joints left have none to spare
        assert not locked or "j2" in page._numbers.content
    best = page.draw().worst_case
    assert f"{best:.6f}"[:5] in page._status.content
    assert best > picture(page.arm, page.arm.chain.mid_range).worst_case


@pytest.fixture(scope="module")
def planned(arm, tmp_path_factory):
    return planned_path(arm, tmp_path_factory.mktemp("path"))


def planned_path(arm, folder):
    """A path.json of a line of the tool, with the test of every failure: not all survive."""
    count = 9
    start = np.array([0.3, 0.5, -0.4, 1.0, 0.3, 0.8, 0.2])
    origin, rotation = arm.chain.tip_at(start[:, None])
    line = origin.T + np.linspace(0, 0.12, count)[:, None] * [1.0, 0.5, -0.5]
    poses = Poses(line, np.repeat(rotation[None, ..., 0], count, axis=0), range(6))
    way = follow(arm.chain, start[:, None], poses, 0)[0][:, :, 0]
    assert np.isfinite(way).all()
    ends = survivors(arm.chain, way.T, np.arange(count), poses)
    times = 1.0 + 0.5 * np.arange(count)
    values = {
        "times": times.tolist(),
        "task": list(arm.task.directions),
        "joints": [{"joint": name} for name in arm.chain.names],
        "trajectory": {"configurations": way.tolist(), "ends_at": times[ends.T].tolist()},
    }
    file = folder / "path.json"
    file.write_text(json.dumps(values), encoding="utf-8")
    return file, values, poses


def test_after_a_failure_the_tool_stays_on_the_path_and_the_joint_where_it_is(arm, planned):
    file, _, poses = planned
    path = PlannedPath.read(file, arm)
    whole = 0
    for joint, sample in product(range(arm.size), (0, 3, 7)):
        failure = path.after(joint, sample)
        way, end = failure.configurations, failure.end
        assert end == path.ends[sample, joint]
        whole += end == 8
        np.testing.assert_array_equal(way[:sample], path.configurations[:sample])
        np.testing.assert_allclose(way[sample:, joint], way[sample, joint], atol=1e-12)
        tips = np.array([picture(arm, q).tip for q in way[: end + 1]])
        np.testing.assert_allclose(tips, poses.positions[: end + 1], atol=1e-5)
        assert ("can be finished" in path.words(9.0, failure)) == (end == 8)
    assert 0 < whole < 21
    np.testing.assert_allclose(path.at(1.25), path.configurations[2:4].mean(axis=0))
    assert path.nearest(1.3) == 3


def test_a_path_is_played_and_a_joint_locks_on_it(arm, file, planned):
    path = PlannedPath.read(planned[0], arm)
    with opened(file, path=path) as page:
        page.panel.time.value = 1.1
        np.testing.assert_allclose(page.positions, path.at(1.1), atol=1e-9)
        fatal = int(np.argmin(path.ends[2]))
        name = arm.chain.names[fatal]
        assert name in page.panel._text.content
        page._locks[name].value = True
        assert (page.panel.failure.sample, page.panel.time.value) == (2, 1.0)
        assert f"{name} locked at 1.00 s: the path ends" in page.panel._text.content
        page.panel.time.value = 4.0
        np.testing.assert_allclose(page.positions[fatal], path.configurations[2, fatal])
        page._locks[name].value = False
        np.testing.assert_allclose(page.positions, path.configurations[-1], atol=1e-9)
        page.panel.play()  # from the start, as it is at its end
        deadline = time.monotonic() + 30
        while page.panel.time.value <= 0.1:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        page.panel.play()
        assert not page.panel._playing.is_set()


def test_what_is_no_path_of_this_arm(arm, planned, tmp_path, patched):
    values, file = planned[1], tmp_path / "path.json"
    changes = (
        {"times": ...},
        {"task": "sideways"},
        {"joints": [{"joint": "j9"}]},
        {"times": lambda times: times[::-1]},
        {"trajectory.configurations": lambda way: way[1:]},
        {"trajectory.ends_at": lambda ends: [[99.0] * 7, *ends[1:]]},
        {"trajectory.configurations": lambda way: [["a"] * 7, *way[1:]]},
    )
    for content in (*(patched(values, change) for change in changes), [1]):
        file.write_text(json.dumps(content), encoding="utf-8")
        with pytest.raises(InputError, match=r"beside is .*path.json of `path`"):
            PlannedPath.read(file, arm)


def test_a_mesh_is_drawn_and_another_file_refused(file, tmp_path):
    trimesh.creation.box().export(tmp_path / "box.ply")
    opened(file, mesh=tmp_path / "box.ply").thing.close()
    (tmp_path / "bad.ply").write_text("ply")
    with pytest.raises(InputError, match="beside is"):
        opened(file, mesh=tmp_path / "bad.ply")


def test_a_missing_viser_is_named(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError, match=r"viser is missing: .*pip install .*vi(ser|ew)"):
        opened(file)
    with pytest.raises(InputError, match="viser is missing"):
        view("missing.urdf")  # the extra that has all it needs is named first


def test_a_page_of_another_site_is_not_served(page):
    """By its `Origin`, or by a name of its own that resolves to this machine (rebinding)."""
    port = page.address.port
    hosts = ("127.0.0.1", "localhost", "other.example")
    for host, said in product(hosts, (None, "http://{}", "http://other.example", "null")):
        origin = said and said.format(f"{host}:{port}")
        here = socket.create_connection(("127.0.0.1", port))
        how = {"origin": origin, "subprotocols": [Subprotocol(f"viser-v{viser.__version__}")]}
        with connect(f"ws://{host}:{port}", sock=here, **how) as client:
            if host != "other.example" and (origin is None or host in origin):
                assert client.recv(timeout=60)
            else:
                with pytest.raises(ConnectionClosed, match="1008"):
                    client.recv(timeout=60)


BODY = '<body pos="0 0 1"><joint axis="1 0 0"/><geom size=".1"/>'
MESH = '<visual><geometry><mesh filename="package://nobody/a.stl"/></geometry></visual>'


def test_what_cannot_be_drawn_is_a_note_and_lines_are(text, tmp_path):
    mjcf = f"<mujoco><worldbody>{BODY * 3}{'</body>' * 3}</worldbody></mujoco>"
    for broken, task, said in (
        (MESH, "all", "1 shapes of .* not drawn: there is no .*a.stl"),
        (MESH.replace("/>", ' scale="x"/>'), "all", "Shapes of .* are not drawn"),
        (None, "vy,vz", "No shapes are drawn"),  # of MJCF
    ):
        shapes = text.replace('<link name="l0"/>', f'<link name="l0">{broken}</link>')
        path = tmp_path / "arm.urdf"
        path.write_text(shapes if broken else mjcf, encoding="utf-8")
        with opened(path, task) as shown:
            [note] = shown.notes
            assert re.match(said, note)
            assert len(shown.draw().origins) == shown.arm.size


def start(lockedjoint, file, *options):
    """Start the command; return its process and its address."""
    process = lockedjoint.start(
        "view", file, "--address=127.0.0.1:0", "--json", *options, cwd=file.parent
    )
    said = ""
    while "}" not in said:
        line = process.stdout.readline()
        assert line, process.stderr.read()
        said += line
    return process, json.loads(said)["url"]


@pytest.mark.processes
def test_the_command_serves_a_page_and_ends_with_ctrl_c(lockedjoint, file):
    process, url = start(lockedjoint, file)
    try:
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=120) as answer:
            assert b"<html" in answer.read()
        used = lockedjoint(
            "view", file, "--address", url.removeprefix("http://"), cwd=file.parent
        )
        assert used.returncode == 2
        assert "in use; allowed: a free port of 127.0.0.1" in used.stderr
        assert used.stderr.count("\n") == 1
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=120)
        assert (process.returncode, said) == (130, "Interrupted.\n")
    finally:
        process.kill()


def test_addresses():
    assert (Address(port=0).free().local, Address("0.0.0.0").local) == (True, False)
    assert Address("::1", 80).url == "http://[::1]:80"
    for host in ("192.0.2.1", "", "a b"):  # an address of nobody's, and no names
        with pytest.raises(InputError, match="host of the address is"):
            Address(host).free()


def slide_to(tab, slider, key, value):
    for _ in range(40):  # until the page listens
        slider.press(key)
        if slider.get_attribute("aria-valuenow") == value:
            return
        tab.wait_for_timeout(250)


@pytest.mark.long
@pytest.mark.processes
@pytest.mark.skipif(BROWSER is None, reason="install chromium (Debian: chromium)")
def test_a_browser_plays_a_path_locks_a_joint_and_shows_names_as_text(
    lockedjoint, text, tmp_path
):
    from playwright.sync_api import expect, sync_playwright

    wicked = [name for name in NAMES if "<" in name or "[" in name or "{" in name][:7]
    file = tmp_path / "arm.urdf"
    file.write_text(in_urdf(text, wicked), encoding="utf-8")
    arm = Robot(file).arm
    beside, _, _ = planned_path(arm, tmp_path)
    path = PlannedPath.read(beside, arm)
    fatal = int(np.argmin(path.ends[0]))
    name, end = printable(arm.chain.names[fatal]), path.ends[0, fatal] / 2
    process, url = start(lockedjoint, file, "--beside", beside)
    try:
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=BROWSER, args=SOFTWARE)
            tab = browser.new_page(viewport={"width": 480, "height": 320})
            tab.set_default_timeout(90_000)  # drawn without a graphics card
            expect.set_options(timeout=90_000)
            tab.goto(url)
            row, sliders = tab.get_by_role("row"), tab.get_by_role("slider")
            worst = row.filter(has_text="worst case of one more")
            first, last = (picture(arm, path.at(time)).worst_case for time in (0.0, 4.0))
            assert abs(last - first) > 1e-3
            expect(worst).to_contain_text(f"{first:.4f}")
            slide_to(tab, sliders.first, "End", "4")
            expect(tab.get_by_text("4.00 s of 4.00 s")).to_be_visible()
            expect(worst).to_contain_text(f"{last:.4f}")
            slide_to(tab, sliders.first, "Home", "0")
            tab.get_by_label(f"lock {name}").check()
            locked = f"{name} locked at 0.00 s: the path ends at {end:.2f} s"
            expect(tab.get_by_text(locked)).to_be_visible()
            expect(tab.get_by_role("table")).to_contain_text(name)
            tab.get_by_role("button", name="Play").click()
            expect(tab.get_by_text("4.00 s of 4.00 s")).to_be_visible()
            other = next(k for k in range(arm.size) if k != fatal)
            slide_to(tab, sliders.nth(1 + other), "End", f"{arm.bounds[1][other]:g}")
            moved = path.at(4.0, path.after(fatal, 0))
            moved[other] = arm.bounds[1][other]
            left = picture(arm, moved, [arm.chain.names[fatal]]).sigma_left
            expect(row.filter(has_text="locked joints out")).to_contain_text(f"{left:.4f}")
            tab.get_by_role("button", name="Best posture").click()
            expect(tab.get_by_text("free joints between")).to_be_visible()
            assert "OWNED" not in tab.title()
            assert tab.locator("iframe, main a, td a, td img").count() == 0
            browser.close()
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=120)
