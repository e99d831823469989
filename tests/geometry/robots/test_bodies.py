"""Links of robots, against MuJoCo and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from dicedesign.geometry.robots.bodies import list_bodies
from dicedesign.geometry.robots.links import NamedBody
from dicedesign.rest.poses import rest_poses

MJCF = """<mujoco>
<compiler angle="degree" meshdir="meshes" eulerseq="xYz"/>
<default>
 <geom density="700"/><mesh scale=".01 .01 .01"/>
 <default class="visual"><geom contype="0" conaffinity="0" density="0"/></default>
 <default class="small"><mesh scale=".02 -.01 .01"/><geom density="2000"/></default>
</default>
<include file="more.xml"/>
<asset><mesh file="a.stl"/>
 <mesh name="moved" file="c.stl" refpos="3 2 1" refquat="1 2 3 4"/></asset>
<worldbody><geom type="plane" size="1 1 1"/>
<body name="base" pos="1 2 3" euler="10 20 30" childclass="small">
 <geom type="mesh" mesh="a" pos=".1 .2 .3" euler="30 40 50"/>
 <geom type="mesh" mesh="more" zaxis="1 2 3" class="visual" density="500"/>
 <geom type="box" size=".1 .2 .3" axisangle="1 1 0 30" pos=".2 0 0"/>
 <body name="arm">
  <geom type="box" size=".1 .2" fromto="0 0 0 .3 .2 .5" mass="2"/>
  <geom type="mesh" mesh="moved" xyaxes="1 1 0 0 1 1" pos=".1 0 0" class="main"/>
  <frame pos=".3 0 0" euler="0 0 45"><geom type="mesh" mesh="a" euler="0 30 0"/></frame>
  <body><inertial pos=".02 .01 -.02" mass="3" fullinertia=".03 .02 .04 .001 .002 .003"/>
   <geom type="mesh" mesh="a" class="visual"/><geom type="box" size=".2 .1 .1"/></body>
 </body></body>
<body name="round">
 <geom type="capsule" size=".1" fromto="0 0 0 .3 .2 .5"/><geom type="cylinder" size=".1 .3"/>
 <geom type="ellipsoid" size=".1 .2 .3" pos=".3 0 0"/><geom size=".2" pos="0 0 .3"/></body>
</worldbody></mujoco>"""

MORE = """<mujoco><default class="main"><geom friction="1"/></default>
<asset><mesh name="more" file="b.obj" class="small"/></asset></mujoco>"""

LINK = """<link name="{name}">{inertial}
<{kind}><origin xyz=".1 .2 .3" rpy=".3 -.5 1.2"/><geometry>{shape}</geometry></{kind}></link>"""

INERTIAL = """<inertial><origin xyz=".12 .21 .28" rpy=".1 .2 .3"/><mass value="3"/>
<inertia ixx=".03" iyy=".02" izz=".04" ixy=".001" ixz=".002" iyz=".003"/></inertial>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    points = np.random.default_rng(1).normal([3.0, 1.0, -2.0], [1.0, 2.0, 3.0], (25, 3))
    (tmp_path / "meshes").mkdir()
    for name in ("a.stl", "a.3mf", "b.obj", "c.stl"):
        trimesh.convex.convex_hull(points).export(tmp_path / "meshes" / name)
    (tmp_path / "more.xml").write_text(MORE)
    return tmp_path


def test_bodies_are_those_of_mujoco(folder: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra 'bench' is not installed")

    def turn_of(quaternion: np.ndarray) -> np.ndarray:
        return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()

    (folder / "robot.xml").write_text(MJCF)
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    sources = list_bodies(folder / "robot.xml")
    assert [source.name for source in sources] == ["base", "arm", "body 3", "round"]
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for number, source in enumerate(sources, start=1):
        body = source.read()
        known = body.mass_properties
        assert known is not None
        assert (source.unit, source.has_mass) == ("m", True)
        assert known.mass == pytest.approx(model.body_mass[number], rel=1e-6)
        np.testing.assert_allclose(known.center_of_mass, model.body_ipos[number], atol=1e-7)
        axes = turn_of(model.body_iquat[number])
        inertia = (axes * model.body_inertia[number]) @ axes.T / known.mass
        # Polyhedra stand for round shapes.
        size = 1e-6 if source.name != "round" else 3e-3
        np.testing.assert_allclose(known.inertia, inertia, atol=size * np.abs(inertia).max())
        if source.name == "round":
            continue
        corners = np.stack(np.meshgrid(*[(-1, 1)] * 3), -1).reshape(-1, 3)
        heights = [np.full(len(directions), -np.inf)]
        for geom in np.flatnonzero((model.geom_bodyid == number) & (model.geom_contype > 0)):
            mesh = model.geom_dataid[geom]
            points = corners * model.geom_size[geom]
            if mesh >= 0:
                start = model.mesh_vertadr[mesh]
                points = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
            points = points @ turn_of(model.geom_quat[geom]).T + model.geom_pos[geom]
            heights.append((directions @ points.T).max(axis=1))
        ours = (directions @ body.points.T).max(axis=1)
        np.testing.assert_allclose(ours, np.max(heights, axis=0), atol=1e-6)
        assert rest_poses(body).center_of_mass_source == known.source


def urdf_link(folder: Path, shape: str, inertial: str = "", kind: str = "collision") -> NamedBody:
    link = LINK.format(name="arm", shape=shape, inertial=inertial, kind=kind)
    shown = '<visual><geometry><sphere radius="9"/></geometry></visual></link>'
    link = link.replace("</link>", shown) if kind == "collision" else link
    (folder / "robot.urdf").write_text(f'<robot name="r">{link}<link name="none"/></robot>')
    (source,) = list_bodies(folder / "robot.urdf")
    return source


@pytest.mark.parametrize(
    ("shape", "extents", "volume"),
    [
        ('<box size="1 2 3"/>', (1.0, 2.0, 3.0), 6.0),
        ('<cylinder radius="1" length="3"/>', (2.0, 2.0, 3.0), 3.0 * np.pi),
        ('<sphere radius="1"/>', (2.0, 2.0, 2.0), 4.0 / 3.0 * np.pi),
        ('<capsule radius="1" length="3"/>', (2.0, 2.0, 5.0), 13.0 / 3.0 * np.pi),
        ('<mesh filename="meshes/a.stl" scale="1 -2 3"/>', None, None),
        ('<mesh filename="package://{}/meshes/a.stl" scale="1 -2 3"/>', None, None),
        ('<mesh filename="meshes/a.3mf" scale="1000 -2000 3000"/>', None, None),
    ],
)
@pytest.mark.parametrize("kind", ["collision", "visual"])
def test_shapes_of_urdf_links(
    folder: Path, shape: str, extents: tuple[float, ...], volume: float, kind: str
) -> None:
    """Rotations are about fixed axes, in the order x, y, z."""
    turn = Rotation.from_euler("xyz", [0.3, -0.5, 1.2]).as_matrix()
    center = np.array([0.1, 0.2, 0.3])
    if extents is None:
        mesh = trimesh.load(folder / "meshes" / "a.stl")
        mesh.vertices *= (1.0, -2.0, 3.0)
        volume, expected = abs(mesh.volume), mesh.vertices
        middle = mesh.center_mass
    else:
        expected, middle = trimesh.creation.box(extents).vertices, np.zeros(3)
    bare = urdf_link(folder, shape.format(folder.name), kind=kind)
    body = bare.read()
    own = (body.points - center) @ turn
    np.testing.assert_allclose(own.min(axis=0), expected.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(own.max(axis=0), expected.max(axis=0), atol=1e-12)
    assert body.mass_properties is not None
    assert (bare.unit, bare.has_mass) == ("m", False)
    assert body.mass_properties.volume == pytest.approx(volume)
    place = turn @ middle + center
    np.testing.assert_allclose(body.mass_properties.center_of_mass, place, atol=1e-9)
    # With an inertial frame.
    source = urdf_link(folder, shape.format(folder.name), INERTIAL, kind)
    known = source.read().mass_properties
    assert known is not None
    assert source.has_mass
    assert known.mass == 3.0
    frame = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    tensor = np.array([[30, 1, 2], [1, 20, 3], [2, 3, 40]]) / 1000.0
    np.testing.assert_allclose(3.0 * known.inertia, frame @ tensor @ frame.T, atol=1e-15)
    np.testing.assert_array_equal(known.center_of_mass, [0.12, 0.21, 0.28])
