"""Make what README.md and the pages of docs show from finished runs: the tables of
recipes and the gallery.

Usage, after `dicedesign run` of every recipe and benches with `--out outputs/bench`:
    python tests/readme_material.py outputs
prints the tables in Markdown and writes outputs/gallery/*.png.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from common.headless import headless_browser
from PIL import Image

from dicedesign.cli.main import main
from dicedesign.view.application import View

TITLE = 66
"""Pixels above each view that hold its title."""


def row(result: dict) -> str:
    """One line of the table."""
    facets = [facet for facet in result["facets"] if facet["label"] is not None]
    seconds = {stage["name"]: stage["seconds"] for stage in result["stages"]}
    # Unknown for a given center of mass; not there without engraving.
    printed = result.get("engraved", {})
    engraved, balance = printed.get("max_abs_error"), printed.get("balance")
    cells = [
        f"`{result['name']}`",
        str(len(result["labels"])),
        f"{len(facets)} + {len(result['facets']) - len(facets)}",
        f"{result['design']['max_abs_error']:.1e}",
        f"{result['max_abs_error']:.1e}",
        f"{balance['errors'][0]:.1e}" if balance is not None else "unknown",
        f"{engraved:.1e}" if engraved is not None else "unknown",
        f"{2.0 * min(facet['inradius_mm'] for facet in facets):.1f}",
        f"{min(facet['margin_deg'] for facet in facets):.0f}",
        f"{seconds['design']:.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


def concave_row(result: dict) -> str:
    """One line of the table of concave dice."""
    concave, engraved = result["concave"], result.get("engraved", {}).get("max_abs_error")
    hull = concave["hull"]
    cells = [
        f"`{result['name']}`",
        str(len(result["labels"])),
        f"{result['max_abs_error']:.1e}",
        f"{result['elsewhere']:.1e}",
        f"{100.0 * concave['displacement']['mean']:.1f}",
        "–" if engraved is None else f"{engraved:.1e}",
        f"{hull['vertices_after']} of {hull['vertices_before']}",
        f"{result['search']['seconds']:.1f}",
        f"{sum(stage['seconds'] for stage in result['stages']):.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


def view(folder: Path, column: int, line: int, size: int) -> Image.Image:
    """One picture out of the grid of a die's views."""
    sheet = Image.open(folder / "views.png").convert("RGB")
    width, height = sheet.width // 4, sheet.height // 2
    side = height - TITLE
    left = column * width + (width - side) // 2
    top = line * height + TITLE
    return sheet.crop((left, top, left + side, top + side)).resize((size, size))


def gallery(outputs: Path, target: Path) -> None:
    """All dice, and the pictures of one of them."""
    target.mkdir(exist_ok=True)
    folders = sorted(path.parent for path in outputs.glob("*/views.png"))
    size, columns = 170, 8
    strip = Image.new("RGB", (size * columns, size * -(-len(folders) // columns)), "white")
    for i, folder in enumerate(folders):
        place = size * (i % columns), size * (i // columns)
        strip.paste(view(folder, 3, 0, size), place)
    save(strip, target / "dice.png")
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
    results = [json.loads(path.read_text()) for path in sorted(root.glob("*/result.json"))]
    concave = [result for result in results if "concave" in result]
    resting = [result for result in results if result not in concave and "thrown" not in result]
    print("\n".join(map(row, resting)))
    print("\n".join(map(concave_row, concave)))
    gallery(root, root / "gallery")
