"""A room as USD in its text form: one prototype for each file, one instance for each body.

Source: the USDA file format and the schemas UsdGeomMesh and UsdGeomXformable of OpenUSD, by which
points are rows that matrices multiply from the right.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.report.charts.palette import BASINS, rgb
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.scenes.room import Room

__all__ = ["room_usda"]

_HEADER = """#usda 1.0
(
    defaultPrim = "Room"
    metersPerUnit = 1
    upAxis = "Z"
)
"""


def room_usda(room: Room) -> bytes:
    """The content of a .usda file: /Room/Floor and /Room/Body_0, /Room/Body_1, ..., instances of
    the classes /Model_0, /Model_1, ... Meshes have a colour each instead of their materials."""
    wide, deep = (side / 2.0 for side in room.floor)
    plane = np.array([[-wide, -deep, 0], [wide, -deep, 0], [wide, deep, 0], [-wide, deep, 0]])
    parts = [_HEADER]
    colors = rgb(BASINS)
    for number, model in enumerate(room.models):
        assert model.body.triangles is not None
        color = colors[number % len(colors)]
        mesh = _mesh("Mesh", model.body.points, model.body.triangles, color)
        note = f"    custom string file = {_quoted(model.name)}\n"
        parts.append(f'\nclass Xform "Model_{number}"\n{{\n{note}{mesh}}}\n')
    floor = _mesh("Floor", plane, np.array([[0, 1, 2], [0, 2, 3]]), np.array([0.9, 0.9, 0.9]))
    parts.append(f'\ndef Xform "Room"\n{{\n{floor}')
    for k, body in enumerate(room.bodies):
        rows = ", ".join(_tuple(row) for row in body.transform.T)
        parts.append(
            f'    def Xform "Body_{k}" (\n'
            f"        instanceable = true\n        prepend references = </Model_{body.model}>\n"
            "    )\n    {\n"
            f"        matrix4d xformOp:transform = ( {rows} )\n"
            '        uniform token[] xformOpOrder = ["xformOp:transform"]\n    }\n'
        )
    parts.append("}\n")
    return "".join(parts).encode()


def _mesh(name: str, points: Floats, triangles: Integers, color: Floats) -> str:
    """A mesh of one colour (3,)."""
    places = points.astype(np.float32)
    lines = [
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(triangles))}]",
        f"int[] faceVertexIndices = [{', '.join(map(str, triangles.ravel().tolist()))}]",
        f"point3f[] points = [{', '.join(map(_tuple, places))}]",
        f"float3[] extent = [{_tuple(places.min(axis=0))}, {_tuple(places.max(axis=0))}]",
        f"color3f[] primvars:displayColor = [{_tuple(color)}]",
        'uniform token subdivisionScheme = "none"',
    ]
    body = "".join(f"        {line}\n" for line in lines)
    return f'    def Mesh "{name}"\n    {{\n{body}    }}\n'


def _tuple(row: Floats) -> str:
    """Numbers with all digits of their precision."""
    return f"({', '.join(str(number) for number in row)})"


def _quoted(text: str) -> str:
    """A text in quotes; what is no plain letter becomes a question mark."""
    plain = "".join(c if " " <= c <= "~" and c not in '"\\' else "?" for c in text)
    return f'"{plain}"'
