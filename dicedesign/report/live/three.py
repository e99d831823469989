"""The library that draws the 3D view of a page: three.js, of which trimesh brings a copy.

It is under the MIT licence, whose notice is its first line, and is read where trimesh is installed.
"""

from __future__ import annotations

import zipfile
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

__all__ = ["three_script"]

_ARCHIVE: Final = "resources/templates/viewer.zip"

_PAGE: Final = "viewer.html.template"

_BEGINS: Final = "<script>"

_ENDS: Final = "var camera,controls,scene,renderer,tracklight;"
"""Where trimesh's own viewer follows."""

_NEEDED: Final = ("THREE.GLTFLoader", "WebGLRenderer", "Raycaster")


@lru_cache(maxsize=1)
def three_script() -> str | None:
    """The script, without trimesh's own viewer; None where no trimesh with one is installed."""
    found = find_spec("trimesh")
    if found is None or found.origin is None:
        return None
    try:
        with zipfile.ZipFile(Path(found.origin).parent / _ARCHIVE) as archive:
            page = archive.read(_PAGE).decode("utf-8")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    _, begins, rest = page.partition(_BEGINS)
    script, ends, _ = rest.partition(_ENDS)
    if not begins or not ends or any(name not in script for name in _NEEDED):
        return None
    return script
