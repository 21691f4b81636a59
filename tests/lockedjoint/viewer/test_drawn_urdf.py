"""What is drawn of a URDF file is what is measured of it."""

from io import BytesIO

import numpy as np
import pytest
import yourdfpy

from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.viewer.drawn_urdf import drawn_urdf
from tests.lockedjoint.clearance.test_meshes import EDGES, collada

SHAPES = """<robot name="a" version="1.1"><link name="a"/><link name="b"><visual>
<origin xyz="1 0 0" quat_xyzw="0 0 1 1"/><geometry>{}</geometry></visual></link>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/>
<origin xyz="0 0 1" quat_xyzw="1 0 0 1"/></joint></robot>"""


def drawn(text, path):
    """The model that is drawn of a URDF text, and what is missing."""
    content, missing = drawn_urdf(xml_root(text.encode()), path)
    same = yourdfpy.filename_handler_null
    return yourdfpy.URDF.load(BytesIO(content), filename_handler=same), missing


@pytest.mark.parametrize("up", ["Y_UP", "Z_UP"])
def test_meshes_have_their_units(tmp_path, up):
    pytest.importorskip("collada", reason="install pycollada")
    collada(tmp_path / "box.dae", "0.001", up)
    model, missing = drawn(
        SHAPES.format('<mesh filename="box.dae" scale="1 2 1"/>'), tmp_path / "a.urdf"
    )
    assert not missing
    low, high = model.scene.bounds
    # A quarter of a turn about z within one about x.
    edges = 1e-3 * EDGES * [1, 2, 1]
    np.testing.assert_allclose(high - low, edges[[1, 2, 0]], rtol=1e-6)
    np.testing.assert_allclose((high + low) / 2, [1, 0, 1], atol=1e-9)


@pytest.mark.parametrize(
    ("turn", "edges"), [("1 0 0 1", [0.2, 0.8, 0.2]), ("0 1 0 1", [0.8, 0.2, 0.2])]
)
def test_capsules_and_quaternions(tmp_path, turn, edges):
    shapes = SHAPES.replace("1 0 0 1", turn)
    text = shapes.format('<capsule radius="0.1" length="0.6"/>')
    model, missing = drawn(text, tmp_path / "a.urdf")
    assert not missing
    low, high = model.scene.bounds
    np.testing.assert_allclose(high - low, edges, rtol=0.02)
    (joint,) = urdf_tree(xml_root(text.encode())).joints
    np.testing.assert_allclose(model.get_transform("b", "a"), joint.origin, atol=1e-12)


def test_meshes_elsewhere_are_missing(tmp_path):
    (tmp_path / "x.stl").write_text("no mesh")
    path = tmp_path / "robot" / "urdf" / "a.urdf"
    name = str(tmp_path / "x.stl")
    model, missing = drawn(SHAPES.format(f'<mesh filename="{name}"/>'), path)
    assert missing == {name}
    assert not model.scene.geometry
