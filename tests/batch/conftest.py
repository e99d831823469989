"""Fixtures for tests of batches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    """Folder with six bodies in five formats, one of them open, and two other files."""
    folder = tmp_path / "meshes"
    (folder / "b").mkdir(parents=True)
    rng = np.random.default_rng(1)
    for name, extents in (("a.stl", (1, 2, 3)), ("b/box.obj", (3, 4, 4.5)), ("c.off", (1, 1, 1))):
        trimesh.creation.box(extents).export(folder / name)
    trimesh.convex.convex_hull(rng.normal(size=(30, 3))).export(folder / "b" / "hull.PLY", "ply")
    np.savetxt(folder / "b.xyz", rng.normal(size=(20, 3)))
    opened = trimesh.creation.box((2, 3, 5))
    opened.update_faces(np.arange(12) > 1)
    opened.export(folder / "open, as it is.obj")
    (folder / "notes.txt").write_text("no mesh")
    (folder / ".hidden.stl").write_text("no mesh")
    return folder
