"""pictures of README.md and docs/: dice, figures of reports, and the pages in a browser

Design what the pictures show, with the seeds of the recipes, and write outputs/gallery/NAME.png, or
into the folder of --out. Pictures of pages need Debian's chromium. Named pictures are made alone.
With --quick a picture of each kind is made, of fewer dice, and kept only with --out; those of pages
are skipped without a browser.
"""

from __future__ import annotations

import argparse
import io
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from PIL import Image, ImageOps

from benchmarks.browser import headless_browser, missing_browser, served_app
from benchmarks.frame import RECORDED, Report, make_die, processes
from benchmarks.screenshots import LAPTOP, PHONE, STEPS, open_page, screenshot, take_steps
from dicedesign import InputError, Recipe, read_recipe
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import run as run_recipe
from dicedesign.recipe.reading import parse_recipe, parse_target
from dicedesign.report.colored_die import color_parts, die_picture
from dicedesign.results.folder import PAGE, read_result
from dicedesign.scenes.picture import room_picture
from dicedesign.scenes.room import scatter_bodies
from dicedesign.throws.goodness_of_fit import judge_rolls
from dicedesign.throws.roll_log import RollLog

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT = RECORDED.parents[1]

GALLERY = ROOT / "outputs" / "gallery"
"""Folder of the pictures."""

WISHES = (
    *("d3", "d4", "d5", "d6", "d7", "d9", "d11", "2d4", "2d6", "3d4", "4dF"),
    *("70%,20%,10%", "90%,5%,5%", "1:2:3:4", "31%,27%,20%,12%,10%", "1/12,1/6,1/2,1/4"),
)
"""Targets of the dice in the first picture, as the design command takes them."""

NAMED = {"1/12,1/6,1/2,1/4": "miss,graze,hit,crit"}
"""Labels of these; others have numbers."""

HENDECAHEDRON, COIN, DUCK, TABLE = "2d6_hendecahedron", "coin", "fair_d3_duck", "2d6_table"
"""Dice whose reports are shown, by the names of their recipes."""

COIN_TARGET, COIN_LABELS = "1/2,1/3,1/6", "heads,tails,edge"
"""Target and labels of `COIN`, as in the page for makers."""

ROLLS = {2: 1, 3: 4, 4: 9, 5: 11, 6: 15, 7: 19, 8: 14, 9: 12, 10: 8, 11: 6, 12: 1}
"""Throws in the picture of their page, by label: those of the file on the page about tables."""

COUNT, SEED = 60, 3
"""Bodies on the floor, and random seed of their places."""

WIDTH = 1000
"""Width of figures in pixels: that of a page."""

CELL, CELL_GAP, COLUMNS = 170, 24, 8
"""Side in pixels of a die in a sheet, gap between two, and dice in a row."""

SHEET_GAP = 16
"""Pixels between pictures of pages."""

STEP_SIZE = (492, 308)
"""Size in pixels of a step in the sheet of steps."""

PHONE_HEIGHT, BOTH_HEIGHT = 480, 520
"""Heights in pixels of the steps on a phone, and of a page on a laptop beside that on a phone."""

COLORS = 255
"""Number of colors of a picture."""

ImageMaker = Callable[["Studio"], Image.Image]


class Studio:
    """Dice and pages, each made when a picture first needs it.

    Attributes
    ----------
    folder: for files, not kept. jobs: processes. is_quick: fewer dice.
    errors: dice that miss their targets, and errors of scripts of pages.
    """

    def __init__(self, folder: Path, jobs: int, is_quick: bool, ends: ExitStack) -> None:
        self.folder, self.jobs, self.is_quick = folder, jobs, is_quick
        self.errors: list[str] = []
        self._ends = ends
        self._walks: dict[tuple[int, int], list[Image.Image]] = {}

    def make_dice(
        self, recipes: Sequence[Recipe], *, enlarge: bool = False
    ) -> list[tuple[Image.Image, bytes]]:
        """Pictures and STL files of engraved dice. enlarge: see `make_die`."""
        make = partial(make_one, enlarge=enlarge)
        with processes(self.jobs) as workers:
            done = list(workers.map(make, recipes[: 2 if self.is_quick else None]))
        self.errors += [error for *_, error in done if error]
        return [(Image.open(io.BytesIO(picture)), solid) for picture, solid, _ in done]

    @cached_property
    def shipped(self) -> list[tuple[Image.Image, bytes]]:
        """Dice of the recipes, but those for a table and of any shape."""
        recipes = [read_recipe(path) for path in sorted((ROOT / "recipes").glob("*.yaml"))]
        return self.make_dice(
            [one for one in recipes if not (one.method.is_thrown or one.method.concave)]
        )

    def run(self, name: str) -> Path:
        """Folder with all files of a die. name: of a recipe, or `COIN`."""
        folder = self.folder / name
        if not folder.exists():
            is_coin = name == COIN
            recipe = ROOT / "recipes" / f"{name}.yaml"
            given = wish(COIN_TARGET, COIN_LABELS, COIN) if is_coin else read_recipe(recipe)
            result = run_recipe(given, folder, enlarge=is_coin)
            if not result.converged:
                self.errors.append(f"{name}: {result.message}")
        return folder

    @cached_property
    def browser(self) -> Browser:
        """Chromium, until the end of the bench."""
        return self._ends.enter_context(headless_browser())

    def walk(self, size: tuple[int, int]) -> list[Image.Image]:
        """Pictures of `STEPS` in a window of a size in pixels."""
        if size not in self._walks:
            # It imports starlette.
            from dicedesign.view.application import make_page

            with (
                served_app(partial(make_page, None)) as gate,
                open_page(self.browser, gate.address, size, self.errors) as page,
            ):
                self._walks[size] = list(islice(take_steps(page), 1 if self.is_quick else None))
        return self._walks[size]


def wish(target: str, labels: str | None, name: str) -> Recipe:
    """Recipe of the design command."""
    return parse_recipe({"name": name, "target": parse_target(target, labels)})


def make_one(recipe: Recipe, enlarge: bool) -> tuple[bytes, bytes, str]:
    """Picture (WebP) and STL file of an engraved die, and a message if it misses its target."""
    work = make_die(recipe, last="engrave", enlarge=enlarge)
    result = work.result()
    picture = die_picture(color_parts(die_contents(work).parts, result), result, 2 * CELL)
    error = "" if result.converged else f"{recipe.name}: {result.message}"
    return picture, work.files["die.stl"], error


def lay_out(
    pictures: Sequence[Image.Image], columns: int, width: int, height: int, gap: int = SHEET_GAP
) -> Image.Image:
    """Pictures in rows on white, each shrunk to a cell in pixels and in its middle."""
    rows = -(-len(pictures) // columns)
    columns = min(columns, len(pictures))
    size = (columns * (width + gap) - gap, rows * (height + gap) - gap)
    sheet = Image.new("RGB", size, "white")
    for k, each in enumerate(pictures):
        shrunk = each.convert("RGBA")
        shrunk.thumbnail((width, height), Image.Resampling.LANCZOS)
        left = k % columns * (width + gap) + (width - shrunk.width) // 2
        top = k // columns * (height + gap) + (height - shrunk.height) // 2
        sheet.paste(shrunk, (left, top), shrunk)
    return sheet


def join(pictures: Sequence[Image.Image], height: int) -> Image.Image:
    """Pictures in a row on white, each shrunk to a height in pixels."""
    shrunk = [
        each.convert("RGB").resize(
            (each.width * height // each.height, height), Image.Resampling.LANCZOS
        )
        for each in pictures
    ]
    sheet = Image.new("RGB", (sum(each.width + SHEET_GAP for each in shrunk) - SHEET_GAP, height))
    sheet.paste("white", (0, 0, *sheet.size))
    left = 0
    for each in shrunk:
        sheet.paste(each, (left, 0))
        left += each.width + SHEET_GAP
    return sheet


def dice_sheet(dice: Sequence[tuple[Image.Image, bytes]]) -> Image.Image:
    """Colored dice in rows."""
    sheet = lay_out([picture for picture, _ in dice], COLUMNS, CELL, CELL, CELL_GAP)
    return ImageOps.expand(sheet, CELL_GAP // 2, "white")


def designed(studio: Studio) -> Image.Image:
    """Dice that `dicedesign design` makes."""
    recipes = [wish(text, NAMED.get(text), f"die_{k}") for k, text in enumerate(WISHES)]
    return dice_sheet(studio.make_dice(recipes, enlarge=True))


def room(studio: Studio) -> Image.Image:
    """Dice of the recipes on a floor."""
    folder = studio.folder / "room"
    folder.mkdir()
    names = [f"{k:02}.stl" for k in range(len(studio.shipped))]
    for name, (_, solid) in zip(names, studio.shipped, strict=True):
        (folder / name).write_bytes(solid)
    scene = scatter_bodies(folder, names, COUNT, SEED, size=1.0)
    return narrow(Image.open(io.BytesIO(room_picture(scene))))


def figure(name: str, stem: str) -> ImageMaker:
    """Figure of the report of a die."""
    return lambda studio: narrow(Image.open(studio.run(name) / f"{stem}.png"))


def narrow(picture: Image.Image) -> Image.Image:
    """At most as wide as a page, on white."""
    return lay_out([picture], 1, WIDTH, round(WIDTH * picture.height / picture.width))


def step(name: str) -> ImageMaker:
    """A step of the page on a laptop."""
    return lambda studio: studio.walk(LAPTOP)[STEPS.index(name)]


def page_sheet(studio: Studio) -> Image.Image:
    """All steps on a laptop."""
    return lay_out(studio.walk(LAPTOP), 2, *STEP_SIZE)


def phone_strip(studio: Studio) -> Image.Image:
    """All steps on a phone."""
    return join(studio.walk(PHONE), PHONE_HEIGHT)


def on_both(studio: Studio, address: str, ready: str) -> Image.Image:
    """A page on a laptop and on a phone, when something that a selector names is there."""
    shots = []
    for size in (LAPTOP, PHONE):
        with open_page(studio.browser, address, size, studio.errors) as page:
            page.wait_for_selector(ready)
            shots.append(screenshot(page))
    return join(shots, BOTH_HEIGHT)


def report_page(studio: Studio) -> Image.Image:
    """First screen of a report."""
    return on_both(studio, (studio.run(COIN) / PAGE).resolve().as_uri(), "#view.live")


def rolls_page(studio: Studio) -> Image.Image:
    """Page on which throws are tapped."""
    # It imports starlette.
    from dicedesign.view.rolls_page import RollsPage

    die = read_result(studio.run(HENDECAHEDRON))
    log = studio.folder / "rolls.csv"
    throws = [str(label) for label, count in ROLLS.items() for _ in range(count)]
    log.write_text("\n".join(["label", *throws]) + "\n", encoding="utf-8")
    judge = partial(judge_rolls, probabilities=die.target, confidence=0.95)
    rolls = RollsPage(RollLog(log, die.labels), die.target, judge, die.name, die)
    with served_app(rolls.app) as gate:
        return on_both(studio, gate.address, ".face img")


PICTURES: dict[str, ImageMaker] = {
    "designed": designed,
    "dice": lambda studio: dice_sheet(studio.shipped),
    "room": room,
    "views": figure(HENDECAHEDRON, "views"),
    "faces": figure(HENDECAHEDRON, "faces"),
    "gauss_map": figure(HENDECAHEDRON, "gauss_map"),
    "bars": figure(HENDECAHEDRON, "bars"),
    "convergence": figure(HENDECAHEDRON, "convergence"),
    "concave_rests": figure(DUCK, "rests"),
    "concave_before_after": figure(DUCK, "before_after"),
    "table": figure(TABLE, "table"),
    "report": report_page,
    "rolls": rolls_page,
    "page": page_sheet,
    **{f"page_{name}": step(name) for name in STEPS},
    "page_phone": phone_strip,
}
"""What makes each picture, by the name of its file."""

QUICK = ("dice", "room", "gauss_map", "report", "page")
"""One of each kind."""

PAGES = frozenset(name for name in PICTURES if name.startswith(("page", "report", "rolls")))
"""Pictures of pages, which need a browser."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which pictures are made."""
    parser.add_argument(
        "pictures", nargs="*", metavar="PICTURE", help=f"of {', '.join(PICTURES)} (default: all)"
    )


def chosen_names(options: argparse.Namespace, report: Report) -> list[str]:
    """Names of the pictures to make. Raises InputError: a name is unknown, or a browser is missing
    and not only --quick chose the picture."""
    names = list(options.pictures or (QUICK if options.quick else PICTURES))
    for name in names:
        if name not in PICTURES:
            raise InputError(
                f"picture: expected one of {', '.join(PICTURES)}, got {name!r}; correct the name"
            )
    missing, pages = missing_browser(), [name for name in names if name in PAGES]
    if missing is None or not pages:
        return names
    if options.pictures or not options.quick:
        raise InputError(
            f"{pages[0]}: expected the extra 'test' and chromium, got no {missing}; run "
            "pip install 'dicedesign[test]' and apt-get install chromium, or name other pictures"
        )
    report.line(f"skipped: {', '.join(pages)}; {missing} is not installed")
    return [name for name in names if name not in PAGES]


def run(options: argparse.Namespace, report: Report) -> bool:
    """Whether all dice meet their targets and no script of a page failed."""
    names = chosen_names(options, report)
    target = options.out or (None if options.quick else GALLERY)
    row = report.table("pictures", "picture 20s | width 5d | height 6d | kB 5.0f | s 6.1f")
    with TemporaryDirectory() as folder, ExitStack() as ends:
        studio = Studio(Path(folder), options.jobs, options.quick, ends)
        for name in names:
            start = time.perf_counter()
            picture = PICTURES[name](studio)
            data = encode(picture)
            if target is not None:
                target.mkdir(parents=True, exist_ok=True)
                (target / f"{name}.png").write_bytes(data)
            row(name, *picture.size, len(data) / 1000.0, time.perf_counter() - start)
    for error in studio.errors:
        report.line(error)
    return not studio.errors


def encode(picture: Image.Image) -> bytes:
    """PNG file with a palette, which keeps the repository small. Small areas keep their colors."""
    buffer = io.BytesIO()
    reduced = picture.convert("RGB").quantize(COLORS, Image.Quantize.MAXCOVERAGE, kmeans=1)
    reduced.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
