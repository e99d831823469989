"""Make the gallery that README.md and the pages of docs show, from finished runs.

Usage, after `dicedesign run` of every recipe and benches with `--out outputs/bench`:
    python tests/readme_material.py outputs
writes outputs/gallery/*.png.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common.programs import headless_browser
from PIL import Image

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.report.raster import UP, Camera, frame_cameras
from dicedesign.report.renderer import RenderMesh, render
from dicedesign.view.application import View

DESIGNED = (
    *("d3", "d4", "d5", "d6", "d7", "d9", "d11", "2d4", "2d6", "3d4", "4dF"),
    *("70%,20%,10%", "90%,5%,5%", "1:2:3:4", "31%,27%,20%,12%,10%"),
)
"""Targets of the dice in the first picture."""


def view(folder: Path, size: int) -> Image.Image:
    """Die from one of its corners."""
    body = read_body(folder / "die.stl")
    assert body.triangles is not None
    (camera,) = frame_cameras([Camera(np.ones(3), UP)], [body.points])
    surface = RenderMesh(body.points, body.triangles, smooth=False)
    return Image.fromarray(render(surface, camera, size))


def designed(target: Path) -> None:
    """Dice that `dicedesign design` makes."""
    with TemporaryDirectory() as name:
        folders = []
        for number, text in enumerate(DESIGNED):
            folders.append(Path(name, f"{number:02}"))
            assert main(["design", text, "--out", str(folders[-1])]) == 0
        labels = "miss,graze,hit,crit"
        folders.append(Path(name, "hits"))
        command = ["design", "1/12,1/6,1/2,1/4", "--labels", labels, "--out", str(folders[-1])]
        assert main(command) == 0
        save(strip(folders), target / "designed.png")


def strip(folders: list[Path]) -> Image.Image:
    """One view of each die."""
    size, columns = 170, 8
    picture = Image.new("RGB", (size * columns, size * -(-len(folders) // columns)), "white")
    for i, folder in enumerate(folders):
        place = size * (i % columns), size * (i // columns)
        picture.paste(view(folder, size), place)
    return picture


def gallery(outputs: Path, target: Path) -> None:
    """All dice, and the pictures of one of them."""
    target.mkdir(exist_ok=True)
    designed(target)
    folders = sorted(path.parent for path in outputs.glob("*/views.png"))
    save(strip(folders), target / "dice.png")
    shown = outputs / "2d6_hendecahedron"
    for name in ("gauss_map", "bars", "convergence", "views", "faces"):
        save(narrow(Image.open(shown / f"{name}.png")), target / f"{name}.png")
    concave = outputs / "fair_d3_duck"
    for name in ("rests", "before_after"):
        save(narrow(Image.open(concave / f"{name}.png")), target / f"concave_{name}.png", 255)
    save(narrow(Image.open(outputs / "2d6_table" / "table.png")), target / "table.png")
    for path in sorted((outputs / "bench").glob("*.png")):
        save(narrow(Image.open(path)), target / path.name)
    room(outputs, target)
    page(outputs / "2d6_hendecahedron", target)


def page(folder: Path, target: Path) -> None:
    """A die in the browser."""
    shown = View(folder)
    with headless_browser() as browser, TemporaryDirectory() as name:
        opened = browser.new_page(viewport={"width": 1200, "height": 760})
        opened.goto(shown.page.gate.address)
        opened.wait_for_selector("#probabilities")
        # What says that there is no graphics card.
        opened.add_style_tag(content=".mantine-Notification-root { display: none; }")
        opened.wait_for_timeout(10_000.0)
        opened.screenshot(path=f"{name}/page.png")
        picture = Image.open(f"{name}/page.png")
        picture.load()
    shown.close()
    save(narrow(picture), target / "page.png", 255)


def room(outputs: Path, target: Path) -> None:
    """All dice with their labels, on one floor."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for path in outputs.glob("*/die.stl"):
            shutil.copy(path, folder / f"{path.parent.name}.stl")
        picture = folder / "room.png"
        command = ["scatter", name, "--count", "60", "--seed", "3", "--size", "1"]
        assert main([*command, "--out", f"{name}/room.glb", "--figure", str(picture)]) == 0
        save(narrow(Image.open(picture)), target / "room.png", 255)


def narrow(picture: Image.Image) -> Image.Image:
    """As wide as a page."""
    return picture.convert("RGB").resize((1000, round(1000 * picture.height / picture.width)))


def save(picture: Image.Image, path: Path, colors: int = 96) -> None:
    """Few colors do for drawings, and keep the repository small."""
    picture.quantize(colors).save(path, optimize=True)


if __name__ == "__main__":
    root = Path(sys.argv[1])
    gallery(root, root / "gallery")
