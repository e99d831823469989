"""Add a file format: JSON.

`write` gets `Contents`, the parts in millimeters and facts as texts, and returns bytes. Each file
of a run is read back, by `dd.read_body` unless `read` is given. Its probabilities must be those of
the die to 1e-9, or to 1e-6 if `precision` is `float32`.
"""

import json

import numpy as np

import dicedesign as dd
from dicedesign.extensions import FILE_FORMATS, FileFormat, join_surfaces


def write(contents):
    whole = join_surfaces(*contents.parts)
    mesh = {"points": whole.points.tolist(), "triangles": whole.triangles.tolist()}
    return json.dumps({"title": contents.title, **contents.facts, **mesh}).encode()


def read(path):
    data = json.loads(path.read_text())
    return np.array(data["points"]), np.array(data["triangles"])


FILE_FORMATS.register(
    FileFormat(
        name="json",
        line="JSON, for programs of your own",
        unit="mm",
        upward="z",
        precision="float64",
        carries="name, target, probabilities, recipe, checksum",
        write=write,
        read=read,
    )
)

recipe = {"name": "d6", "target": {"fair": 6}, "figures": False, "files": ["json"]}
result = dd.run(recipe, out="outputs/d6")
print(json.loads((result.folder / "die.json").read_text())["Probabilities"])
