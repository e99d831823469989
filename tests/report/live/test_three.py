"""The library of the 3D view is found where trimesh has it, and missed without a fault."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from dicedesign.report.live import three


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The archive of a trimesh that is to be made."""
    spec = ModuleSpec("trimesh", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(three, "find_spec", lambda name: spec)
    archive = tmp_path / "resources" / "templates" / "viewer.zip"
    archive.parent.mkdir(parents=True)
    three.three_script.cache_clear()
    yield archive
    three.three_script.cache_clear()


def test_the_installed_library_is_there_with_its_licence_and_without_trimesh_s_viewer() -> None:
    script = three.three_script()
    assert script is not None
    assert "MIT" in script[:200]
    assert "THREE.GLTFLoader=GLTFLoader" in script
    assert "$B64GLTF" not in script
    assert "</script" not in script


@pytest.mark.parametrize("content", [None, b"no archive", "<script>other();</script>"])
def test_a_trimesh_without_one(installed: Path, content: bytes | str | None) -> None:
    if isinstance(content, bytes):
        installed.write_bytes(content)
    elif content is not None:
        with zipfile.ZipFile(installed, "w") as archive:
            archive.writestr("viewer.html.template", content)
    assert three.three_script() is None


def test_no_trimesh_at_all(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(three, "find_spec", lambda name: None)
    assert three.three_script() is None
