"""Read damaged files of every format: each is read, or refused in words, within time and memory."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np
import trimesh

from dicedesign.batch.rest_table import RestTable
from dicedesign.cli.main import main
from dicedesign.errors import DiceError
from dicedesign.fabricate.icons import icon_section
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.robots.bodies import list_bodies
from dicedesign.recipe.reading import read_recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.prior import read_prior
from dicedesign.results.folder import read_result
from dicedesign.runtime.checkpoint import checkpoint_bytes, read_checkpoint
from dicedesign.throws.roll_log import RollLog, read_counts
from dicedesign.throws.tables import load_table, table_entries
from tests.soak.meshes import mesh_file

SECONDS = 20
"""Limit for one file."""

MEMORY = 1 << 31
"""Limit on additional address space in bytes, on Linux."""

PER_CASE = 100
"""Number of files of a case, all of one format."""

LABELS = ("1", "2", "3")

INSERTED = (b"nan", b"1e400", b"-1", b"99999999999", b"[" * 3000, b"<a>" * 3000, b"\0", b"=")
"""Texts that damage a file."""

URDF = """<robot name="r"><link name="a"><inertial><origin xyz="0 0 .1"/><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><collision>
<geometry><mesh filename="box.stl" scale="1 1 2"/></geometry></collision></link>
<link name="b"><collision><geometry><box size="1 2 3"/></geometry></collision></link></robot>"""

DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g">
<mesh><source id="s"><float_array id="f" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
<technique_common><accessor source="#f" count="4" stride="3"><param name="X" type="float"/><param
name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices><triangles count="4"><input
semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh>
</geometry></library_geometries><library_visual_scenes><visual_scene id="w"><node><matrix>2 0 0 0 0
1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""

MJCF = """<mujoco><asset><mesh name="m" file="box.stl"/></asset><worldbody><body name="a">
<geom type="mesh" mesh="m"/><geom type="box" size=".1 .2 .3" pos="0 1 0"/></body></worldbody>
</mujoco>"""

SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 24 24"><g transform="scale(1 -1)
translate(0 -24)"><path d="M4 4 h16 v16 h-16 z m4 4 q4 0 4 4 t4 4 a2 2 0 0 1 -4 0 c1 2 3 4 5 6z"/>
</g><circle cx="5" cy="6" r="2"/></svg>"""

RECIPE = """name: die
target: {probabilities: [1/2, 1/3, 1/6], labels: [A, B, "7"]}
faces: one
engrave: {depth_mm: 0.6, font: DejaVu Sans}
method: {exact: {starts: 3}}
files: [stl, 3mf]
"""


def read_rests(path: Path) -> None:
    """Read a mesh and find its rests, which must be probabilities."""
    shares = rest_poses(read_body(path)).probabilities
    assert np.isfinite(shares).all()
    assert abs(shares.sum() - 1.0) < 1e-6


def read_robot(path: Path) -> None:
    for body in list_bodies(path):
        body.read()


def originals(folder: Path) -> dict[str, tuple[bytes, Callable[[Path], object]]]:
    """Whole files and their readers, by ending; folder: in which a die was made."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    points, triangles = np.asarray(box.vertices), np.asarray(box.faces)
    endings = (".stl", ".text.stl", ".obj", ".ply", ".off", ".xyz", ".glb", ".3mf")
    cases: dict[str, tuple[bytes, Callable[[Path], object]]] = {
        ending: (mesh_file(ending, points, triangles), read_rests) for ending in endings
    }
    rows = [np.zeros(3), np.ones(2)]
    checkpoint = checkpoint_bytes({"seed": "1"}, {"rows": {"a": [3, 2]}}, {"a": np.hstack(rows)})
    table = (folder / "rests.csv").read_bytes()
    return cases | {
        ".dae": (DAE.encode(), read_rests),
        ".urdf": (URDF.encode(), read_robot),
        ".xml": (MJCF.encode(), read_robot),
        ".svg": (SVG.encode(), lambda path: icon_section(str(path), "1")),
        ".yaml": (RECIPE.encode(), read_recipe),
        ".table.json": (
            json.dumps(table_entries("board-game")).encode(),
            lambda path: load_table(str(path)),
        ),
        ".counts.csv": (
            b"label,count\n1,20\n2,30\n3,10\n", lambda path: read_counts(path, LABELS)
        ),
        ".log.csv": (b"label\n1\n2\n3\n1\n", lambda path: RollLog(path, LABELS)),
        ".prior.csv": (
            b"x,y,z,weight\n0,0,1,1\n1,0,0,2\n", lambda path: read_prior(f"samples:{path}")
        ),
        ".rests.csv": (table, RestTable.read),
        ".rests.json": ((folder / "rests.json").read_bytes(), RestTable.read),
        ".npz": (
            checkpoint,
            lambda path: read_checkpoint(path, {"seed": "1"}, lambda state, arrays: dict(arrays)),
        ),
        "/result.json": (
            (folder / "die" / "result.json").read_bytes(),
            lambda path: read_result(path.parent),
        ),
    }  # fmt: skip


def make_originals(folder: Path) -> None:
    """Make what `originals` needs: a mesh, tables of its rests, and a die."""
    trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / "box.stl")
    (folder / "die.yaml").write_text("name: die\ntarget: {fair: 4}\nfaces: one\nengrave: false\n")
    for ending in ("csv", "json"):
        line = ["rest", str(folder / "box.stl"), "--jobs", "1"]
        assert main([*line, "--out", str(folder / f"rests.{ending}")]) == 0
    line = ["run", str(folder / "die.yaml"), "--no-figures", "--out", str(folder / "die")]
    assert main(line) == 0


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """Damaged content: bytes changed, cut, repeated or inserted, numbers exchanged."""
    result = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        place, kind = int(rng.integers(len(result) + 1)), rng.integers(8)
        length = int(2.0 ** rng.uniform(0.0, 10.0))
        if kind == 0 and result:
            result[place % len(result)] = int(rng.integers(256))
        elif kind == 1:
            del result[place:]
        elif kind == 2:
            del result[place : place + length]
        elif kind == 3:
            result[place:place] = result[place : place + length] * int(rng.integers(1, 50))
        elif kind == 4:
            result[place:place] = rng.bytes(int(rng.integers(1, 9)))
        elif kind == 5:
            texts = (
                b"nan",
                b"1e400",
                b"-1",
                b"99999999999",
                b"[" * 3000,
                b"<a>" * 3000,
                b"\0",
                b"=",
            )
            result[place:place] = texts[rng.integers(len(texts))]
        elif kind == 6:
            huge = int(rng.choice([0, 1, 2**31 - 1, 2**32 - 1]))
            result[place : place + 4] = huge.to_bytes(4, "little")
        else:
            digits = [k for k, byte in enumerate(result) if byte in b"0123456789"]
            if digits:
                result[digits[rng.integers(len(digits))]] = int(rng.choice(list(b"0123456789-e.")))
    return bytes(result)


@contextmanager
def limits() -> Iterator[None]:
    """Limit the time of the block, where there are alarms."""

    def fail(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {SECONDS} s")

    if not hasattr(signal, "SIGALRM"):
        yield
        return
    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def limit_memory() -> None:
    """Limit the memory that this process may take from now on."""
    if sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))


def try_files(folder: Path, seed: int, number: int) -> list[str]:
    """Read `PER_CASE` damaged files of one format, and list those that neither are read nor refused
    in words. folder: made by `make_originals`."""
    limit_memory()
    cases = originals(folder)
    ending = list(cases)[number % len(cases)]
    data, read = cases[ending]
    rng, faults = np.random.default_rng([seed, number]), []
    place = folder / f"case{number}"
    place.mkdir()
    (place / "box.stl").write_bytes((folder / "box.stl").read_bytes())
    path = place / (ending[1:] if ending.startswith("/") else f"file{ending}")
    for count in range(PER_CASE):
        path.write_bytes(damage(data, rng))
        try:
            with limits():
                read(path)
        except DiceError as error:
            if str(path) not in str(error) and len(str(error)) < 20:
                faults.append(f"{ending} {count}: only {error}")
        except BaseException as error:
            faults.append(f"{ending} {count}: {type(error).__name__}: {str(error)[:200]}")
    return faults
