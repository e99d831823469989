"""Pages, each one HTML file that needs nothing else: the report of a die, whose 3D view, table of
facets and Gauss map are linked, the dice of a sweep, and a set of dice."""

from __future__ import annotations

import gzip
import hashlib
import zipfile
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import Contents, Part, glb
from dicedesign.fabricate.printers import MATERIALS
from dicedesign.palette import outcome_colors, text_color
from dicedesign.report.colored_die import (
    color_parts,
    colored_mesh,
    die_picture,
    main_rest,
    reading_views,
)
from dicedesign.report.discs import MAP_SIZE, RADIUS, basin_outlines, svg_path
from dicedesign.report.figures import FIGURES
from dicedesign.report.raster import (
    UP,
    Camera,
    decode_png,
    encode_webp,
    frame_cameras,
    trim,
)
from dicedesign.report.renderer import render_on_table
from dicedesign.results.parts import Draft, Search, Status, TableResult
from dicedesign.results.result import Result
from dicedesign.results.verdict import judge
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import Spread, Table, most_of, scale

MAP = "gauss_map"
"""Name of the figure that is linked with the 3D view and the table of facets."""

MAX_ATTEMPTS = 12
"""Most attempts at a concave die that are listed."""

POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; "
    "style-src 'unsafe-inline'"
)
"""Content security policy: a page loads nothing and runs no other scripts, whatever its text."""

FLAWS = {
    Status.OFF_TARGET: "probabilities",
    Status.SELF_INTERSECTING: "intersects itself",
    Status.TOO_NEAR: "outcomes near",
    Status.TIPPY: "margin",
    Status.FRAGILE: "prints",
}

PNG_BEGINS = b"\x89PNG"

MAX_TRIANGLES = 60_000
"""Most triangles of a solid in a page; more would add megabytes."""

MAX_WIDTH = 1200
"""Width in pixels of the largest pictures in a page; their files may have more."""

PLATE_PIXELS = 1200
"""Side of the picture of a print bed before it is trimmed."""

DIE_PIXELS, SMALL_PIXELS = 800, 280
"""Widths of pictures of dice in a report and in tables."""


def _in_order(result: Result) -> list[int]:
    """Numbers of the rests in the order of the labels, those of none last."""
    labels = [*result.labels, None]
    return sorted(range(len(result.facets)), key=lambda k: labels.index(result.facets[k].outcome))


@lru_cache(maxsize=1)
def three_script() -> str | None:
    """Source of three.js, as part of the installed trimesh; None if it is not there.

    It is under the MIT license, whose notice is its first line.
    """
    package = find_spec("trimesh")
    if package is None or package.origin is None:
        return None
    viewer = Path(package.origin).parent / "resources/templates/viewer.zip"
    try:
        with zipfile.ZipFile(viewer) as archive:
            page = archive.read("viewer.html.template").decode("utf-8")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    # The viewer of trimesh follows three.js.
    script, ends, _ = page.partition("var camera,controls,scene,renderer,tracklight;")
    _, begins, script = script.partition("<script>")
    needed = ("THREE.GLTFLoader", "WebGLRenderer", "Raycaster")
    return script if begins and ends and all(name in script for name in needed) else None


def _is_moving(image: bytes) -> bool:
    return image.startswith(b"GIF8")


def _data_uri(image: bytes) -> str:
    """Address of a picture. A PNG becomes a WebP of a tenth of its size."""
    if image.startswith(PNG_BEGINS):
        image = encode_webp(decode_png(image), MAX_WIDTH)
    kind = "gif" if _is_moving(image) else "webp"
    return f"data:image/{kind};base64,{b64encode(image).decode('ascii')}"


@lru_cache(maxsize=1)
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("dicedesign.report"),
        extensions=["jinja2.ext.do"],
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        # Number with significant digits; "-" for None.
        "number": lambda value, digits: "-" if value is None else f"{value:.{digits}g}",
        "percent": lambda value: "-" if value is None else f"{100.0 * value:.3f}",
        "vector": lambda values: " ".join(f"{value:.6g}" for value in values),
        "is_moving": _is_moving,
        "data_uri": _data_uri,
        # A higher level of compression gains next to nothing.
        "packed": lambda data: b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii"),
        "most": most_of,
        "lengths": _lengths,
        "ends": _ends,
        "scaled": scale,
        "svg_path": svg_path,
        "text_color": text_color,
    }
    return environment


def _template_file(name: str) -> str:
    return files("dicedesign.report.templates").joinpath(name).read_text("utf-8")


def die_page(die: FinishedDie, images: Mapping[str, bytes], parts: Sequence[Part]) -> str:
    """HTML of the report of a die.

    Deterministic. Without a 3D view, the page says why.

    Parameters
    ----------
    die: the finished die.
    images: PNG or GIF bytes of figures by name, see `FIGURES`; others are left out.
    parts: solids of the printed die, first the one of the STL file.
    """
    result, poses, colored = die.result, die.plain.poses, color_parts(parts, die.result)
    script, three = _template_file("viewer.js"), three_script()
    triangles = sum(len(part.triangles) for part in colored)
    scripts, data, left_out = [script], dict[str, bytes](), ""
    if three is None:
        left_out = "The die cannot be turned here: trimesh is installed without its viewer."
    elif triangles > MAX_TRIANGLES:
        left_out = f"The die cannot be turned here: it has {triangles:,} triangles."
    else:
        solid = glb(Contents(result.name, colored))
        scripts, data = [script, three], {"solid": solid, "three": three.encode()}
    sums = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    policy = " ".join([f"{POLICY}; script-src", *(f"'sha256-{each}'" for each in sums)])
    hidden = {MAP} | {figure.instead_of for figure in FIGURES if figure.name in images}
    print_facts, search, thrown = result.printability, result.search, result.thrown
    simulated = None if thrown is None else thrown.simulated
    return (
        _environment()
        .get_template("die.html.j2")
        .render(
            title=result.name,
            policy=policy,
            style="".join(map(_template_file, ("page.css", "die.css", "print.css"))),
            script=script,
            data=data,
            left_out=left_out,
            result=result,
            verdicts=judge(result),
            still=die_picture(colored, result, DIE_PIXELS),
            views=reading_views(result),
            main_rest=main_rest(result),
            colors=dict(zip(result.labels, outcome_colors(len(result.labels)), strict=True)),
            in_order=_in_order(result),
            heights=poses.hull.heights(poses.center_of_mass)[poses.facets],
            mass_center=poses.center_of_mass,
            outlines=basin_outlines(poses) if MAP in images else [],
            images=images,
            figures=[one for one in FIGURES if one.name in images and one.name not in hidden],
            map=FIGURES[MAP],
            map_image=images.get(MAP),
            map_size=MAP_SIZE,
            map_radius=RADIUS,
            center=", ".join(f"{round(value, 3) + 0.0:.3f}" for value in result.center_of_mass),
            tabletop=None if thrown is None else Table(**thrown.table),
            engine=None if simulated is None else ENGINES[simulated.engine],
            advice=throwing_advice(
                thrown,
                result.prior,
                can_be_thrown=result.forecast is not None and not result.is_warned,
            ),
            drafts=[] if search is None else _best_drafts(search),
            flaws=partial(_flaws, search),
            material=None if print_facts is None else MATERIALS[print_facts.material].title,
        )
    )


def _best_drafts(search: Search) -> list[Draft]:
    """Drafts in order: the one of the die, then by number of flaws, error and displacement."""
    trade_off = search.trade_off

    def rank(draft: Draft) -> tuple[bool, int, float, float]:
        missed = max(draft.error - trade_off.tolerance, 0.0)
        lacks = len(list(trade_off.flaws(draft)))
        return draft.attempt != search.attempt, lacks, missed, draft.displacement

    return sorted(trade_off.drafts, key=rank)[:MAX_ATTEMPTS]


def _flaws(search: Search | None, draft: Draft) -> str:
    assert search is not None
    return ", ".join(FLAWS[status] for status in search.trade_off.flaws(draft)) or "nothing"


def sweep_page(
    name: str,
    rows: Sequence[Mapping[str, Any]],
    keys: Sequence[str],
    dice: Mapping[str, tuple[Sequence[Part], Result]],
) -> str:
    """HTML of the dice of a sweep, side by side.

    Parameters
    ----------
    name: of the recipe. rows: of sweep.csv. keys: columns of the varied keys.
    dice: parts of the printed die in mm, and the result, of each die that was made, by its folder.
    """
    return _table_page(
        "sweep",
        title=f"{name}: sweep",
        rows=rows,
        keys=keys,
        pictures={
            folder: die_picture(color_parts(parts, result), result, SMALL_PIXELS)
            for folder, (parts, result) in dice.items()
        },
    )


def set_page(
    plate: Sequence[Part],
    dice: Sequence[Mapping[str, Any]],
    colored: Sequence[tuple[Sequence[Part], Result]],
) -> str:
    """HTML of a set of dice.

    Parameters
    ----------
    plate: parts by `color_parts` of all dice on the print bed, z upward.
    dice: entries of set.json. colored: parts by `color_parts` and result of each, in this order.
    """
    whole = colored_mesh(plate, is_smooth=False)
    (camera,) = frame_cameras([Camera(np.array([0.0, -0.4, 1.0]), UP)], [whole.points])
    (picture,) = trim([render_on_table(whole, UP, camera, PLATE_PIXELS)])
    return _table_page(
        "set",
        title=f"{len(dice)} dice",
        dice=dice,
        plate=encode_webp(picture),
        pictures=[die_picture(parts, result, SMALL_PIXELS) for parts, result in colored],
    )


def throwing_advice(
    thrown: TableResult | None, prior: str | None = None, *, can_be_thrown: bool = False
) -> str:
    """Instructions to throw a die by hand, depending on its table or its prior.

    can_be_thrown: whether a die for setting down has its probabilities when thrown too.
    """
    if prior is not None:
        return (
            f"Let it go gently, in orientations drawn from the prior {prior}, whose directions "
            "point down in the coordinates of die.stl: the probabilities hold for these, without "
            "momentum. From uniform orientations, or thrown, the die has other probabilities."
        )
    if thrown is None and can_be_thrown:
        return (
            "Throw it, or set it down gently in any orientation: the probabilities hold for both."
        )
    if thrown is None:
        return (
            "Set it down gently, each time in another orientation: the probabilities hold for "
            "rolling without momentum. A thrown die has other probabilities."
        )
    table = Table(**thrown.table)
    if most_of(table.height) == 0.0:
        return "Set it down on the table and let it tip over, from a random orientation."
    moving = max(most_of(table.speed), most_of(table.spin)) > 0.0
    push = " with a little push and spin," if moving else ""
    way = "" if table.hand is None else f" {table.hand.phrase}"
    about = "" if isinstance(table.height, tuple) else "about "
    return (
        f"Throw it{way}: let it fall from {about}{_lengths(table.height)} above the table,{push} "
        "each time from another orientation. Set down gently it has other probabilities."
    )


def _lengths(meters: Spread) -> str:
    in_cm = most_of(meters) < 1.0
    return f"{_ends(scale(meters, 100.0 if in_cm else 1.0), 3)} {'cm' if in_cm else 'm'}"


def _ends(spread: Spread, digits: int) -> str:
    ends = spread if isinstance(spread, tuple) else (spread,)
    return " to ".join(f"{end:.{digits}g}" for end in ends)


def _table_page(name: str, **content: Any) -> str:
    """HTML of a page without scripts, by its template."""
    template = _environment().get_template(f"{name}.html.j2")
    return template.render(policy=POLICY, style=_template_file("page.css"), **content)
