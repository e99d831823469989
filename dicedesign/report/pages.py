"""Pages by jinja2, each one HTML file that needs nothing else: a die's report, a search's best; and
what they say of throws in words."""

from __future__ import annotations

import gzip
import hashlib
import math
from base64 import b64encode
from collections.abc import Iterator, Mapping
from functools import lru_cache, partial
from importlib.resources import files
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.fabricate.printers import MATERIALS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.discs import MAP_SIZE, RADIUS
from dicedesign.report.figures import FIGURES
from dicedesign.report.live_die import LiveDie, three_script
from dicedesign.report.raster import Camera, encoded, lifted
from dicedesign.report.renderer import Surface, render
from dicedesign.results.parts import Draft, OtherTables, Search, SimulatedThrows, Status, ThrownOdds
from dicedesign.results.result import Balance, Result
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.tables import Spread, Table, most_of, scaled

MAP: Final = "gauss_map"
"""Name of the figure that is linked with the table of facets."""

MOST_ATTEMPTS: Final = 12
"""Attempts at a concave die that are listed."""

POLICY: Final = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; "
    "style-src 'unsafe-inline'"
)
"""A page loads nothing and runs no script but its own, whatever a name or a label in it says."""

FLAWS: Final = {
    Status.OFF_TARGET: "odds",
    Status.SELF_INTERSECTING: "meets itself",
    Status.TOO_NEAR: "outcomes near",
    Status.TIPPY: "margin",
}


def _is_moving(image: bytes) -> bool:
    return image.startswith(b"GIF8")


def _data_uri(image: bytes) -> str:
    kind = "gif" if _is_moving(image) else "png"
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
        # With a count of significant digits; "-" where there is none.
        "number": lambda value, digits: "-" if value is None else f"{value:.{digits}g}",
        "percent": lambda value: "-" if value is None else f"{100.0 * value:.3f}",
        "vector": lambda values: " ".join(f"{value:.6g}" for value in values),
        "is_moving": _is_moving,
        "data_uri": _data_uri,
        # By a level of gzip above which next to nothing is gained.
        "packed": lambda data: b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii"),
        "recipe_lines": _recipe_lines,
    }
    return environment


def _template_file(name: str) -> str:
    return files("dicedesign.report.templates").joinpath(name).read_text("utf-8")


def die_page(result: Result, images: Mapping[str, bytes], live: LiveDie | None = None) -> str:
    """The report of any kind of die as HTML.

    Parameters
    ----------
    result: of the run.
    images: PNG or GIF bytes of figures by name, see `FIGURES`; others are left out.
    live: the die for its 3D view; None for a page that does not move.

    Returns
    -------
    str, a whole document; the same for the same arguments.
    """
    hidden = {MAP} | {figure.instead_of for figure in FIGURES if figure.name in images}
    style, policy, script, data = _template_file("page.css"), POLICY, "", {}
    if live is not None:
        script, three = _template_file("viewer.js"), three_script()
        style += _template_file("viewer.css")
        scripts = [script]
        if live.solid is not None and three is not None:
            data = {"solid": live.solid, "three": three.encode()}
            scripts.append(three)
        sums = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
        policy += "; script-src " + " ".join(f"'sha256-{found}'" for found in sums)
    balance = None if result.engraved is None else result.engraved.balance
    found, search = result.printability, result.search
    return (
        _environment()
        .get_template("die.html.j2")
        .render(
            title=result.name,
            policy=policy,
            style=style,
            script=script,
            data=data,
            result=result,
            live=live,
            images=images,
            figures=[one for one in FIGURES if one.name in images and one.name not in hidden],
            map=FIGURES[MAP],
            map_image=images.get(MAP),
            map_size=MAP_SIZE,
            map_radius=RADIUS,
            center=", ".join(f"{round(value, 3) + 0.0:.3f}" for value in result.center_of_mass),
            throws=[] if result.thrown is None else throws_told(result.thrown),
            advice=throwing_advice(result.thrown, result.prior),
            balance_told="" if balance is None else _describe_balance(result, balance),
            # Those of the engraved die before its shape was moved.
            unbalanced=balance.unbalanced
            if result.thrown is None and balance is not None and len(balance.errors) > 1
            else None,
            drafts=[] if search is None else _best_drafts(search),
            flaws=partial(_flaws, search),
            material=None if found is None else MATERIALS[found.material].title,
        )
    )


def _describe_balance(result: Result, balance: Balance) -> str:
    """How labels and edges were made up for, in words."""
    model = "" if result.thrown is None else " by the momentum model"
    plain = f"The plain shape is off by {result.max_abs_error:.1e}. " if not model else ""
    first = f"{plain}With its labels and edges it would be off by {balance.errors[0]:.1e}{model}."
    if len(balance.errors) < 2:
        return f"{first} Nothing was moved."
    how = f"Its facets were moved by up to {balance.moved_mm:.2g} mm"
    if balance.stretch is not None:
        how = f"It was stretched by {100.0 * balance.stretch:.2g} %"
    rounds = len(balance.errors) - 1
    last = f"{min(balance.errors):.1e}{model}"
    error = None if result.engraved is None else result.engraved.max_abs_error
    if not model and error is not None:
        last += f", and {error:.1e} in the file as it was read back"
    times = f"{rounds} round{'' if rounds == 1 else 's'}"
    return f"{first} {how} in {times}, until it was off by {last}."


def _best_drafts(search: Search) -> list[Draft]:
    """The draft of the die itself first, then what lacks least, is nearest to the target and was
    moved least."""
    trade_off = search.trade_off

    def rank(draft: Draft) -> tuple[bool, int, float, float]:
        missed = max(draft.error - trade_off.tolerance, 0.0)
        lacks = len(list(trade_off.flaws(draft)))
        return draft.attempt != search.attempt, lacks, missed, draft.displacement

    return sorted(trade_off.drafts, key=rank)[:MOST_ATTEMPTS]


def _flaws(search: Search | None, draft: Draft) -> str:
    assert search is not None
    return ", ".join(FLAWS[status] for status in search.trade_off.flaws(draft)) or "nothing"


def leaderboard_page(
    table: Mapping[str, Any], shapes: Mapping[int, Mapping[str, Any]], picture: bytes
) -> str:
    """The best dice of a search as HTML.

    Parameters
    ----------
    table: as in leaderboard.json: "name", "size_mm", "trials", "converged" and "leaderboard", each
        entry with "rank", "number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry",
        "on_front", "as_given", "varied" and "recipe_file".
    shapes: by the number of each trial in it, "vertices" (n, 3) of the die in mm and "down" (3,).
    picture: PNG of `dicedesign.report.curve_charts.pareto_chart`.
    """
    numbers = [entry["number"] for entry in table["leaderboard"]]
    pictures = {
        number: lying_die_png(np.array(shape["vertices"]), np.array(shape["down"]))
        for number, shape in shapes.items()
        if number in numbers
    }
    return (
        _environment()
        .get_template("leaderboard.html.j2")
        .render(
            title=f"{table['name']}: search",
            policy=POLICY,
            style=_template_file("page.css"),
            table=table,
            pictures=pictures,
            pareto=picture,
        )
    )


def _recipe_lines(entry: Mapping[str, Any]) -> Iterator[str]:
    """Where the recipe of an entry is, and what the search varied, without the weights that are
    0."""
    yield entry["recipe_file"]
    if entry["as_given"]:
        yield "as given"
    for key, value in entry["varied"].items():
        name = key.rpartition(".")[2]
        if isinstance(value, list):
            yield f"{name} {', '.join(value)}"
        elif not isinstance(value, float):
            yield f"{name} {value}"
        elif value > 0.0:
            yield f"{name} {value:.2g}"


def lying_die_png(vertices: Floats, down: Floats) -> bytes:
    """Picture of a die that lies on a table, somewhat from above.

    The frame is as wide as the largest distance between two vertices.

    vertices: (n, 3) in any length unit; down: (3,) the direction of gravity.
    """
    hull = convex_hull(vertices)
    flat = vertices - vertices.mean(axis=0)
    flat = flat - np.outer(flat @ down, down)
    along, across = np.linalg.svd(flat)[2][:2]
    turn = np.radians(25.0)
    direction = lifted(np.cos(turn) * across + np.sin(turn) * along, -down, 30.0)
    # In the middle of the picture, the die is nowhere wider than its frame.
    frame = Camera(direction, -down).frame()
    seen = vertices @ frame.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2.0 @ frame
    camera = Camera(direction, -down, middle, 0.53 * hull.diameter)
    return encoded(render(Surface(hull.vertices, hull.triangles, smooth=False), camera, 220))


def throws_told(thrown: ThrownOdds) -> list[str]:
    """Paragraphs: how the die is thrown, and what it does then, there and on other tables."""
    verdict = (
        "No throws of it were simulated: what it does on the table is what the momentum model "
        "expects."
    )
    if thrown.simulated is not None:
        verdict = " ".join(_verdict(thrown.simulated))
    told = [_manner(Table(**thrown.table)), verdict]
    if thrown.elsewhere is not None:
        told.append(_elsewhere(thrown.elsewhere))
    return told


def throwing_advice(thrown: ThrownOdds | None, prior: str | None = None) -> str:
    """How to throw a die by hand, perhaps one that was designed for a table, or under a prior."""
    if prior is not None:
        return (
            f"Let it go gently, turned as the prior {prior} says, whose directions point down in "
            "the coordinates of die.stl: the odds are those under it, without momentum. With any "
            "side down alike, or thrown, it has others."
        )
    if thrown is None:
        return (
            "Set it down gently, each time in another orientation: the odds are those of rolling "
            "without momentum. Thrown it has others; the command dicedesign throw shows by how "
            "much."
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
        "each time from another orientation. Set down gently it has other odds."
    )


def _lengths(metres: Spread) -> str:
    in_cm = most_of(metres) < 1.0
    return f"{_numbers(scaled(metres, 100.0 if in_cm else 1.0), 3)} {'cm' if in_cm else 'm'}"


def _numbers(spread: Spread, digits: int) -> str:
    ends = spread if isinstance(spread, tuple) else (spread,)
    return " to ".join(f"{end:.{digits}g}" for end in ends)


def _manner(table: Table) -> str:
    """What throws the odds are for."""
    fall = (
        f"falls from {_lengths(table.height)} above the table, turned at random"
        if most_of(table.height) > 0.0
        else "is set down on the table, turned at random"
    )
    motion = []
    if most_of(table.speed) > 0.0:
        motion.append(f"moves sideways at {_lengths(table.speed)} a second")
    if most_of(table.spin) > 0.0:
        turns = scaled(table.spin, 0.5 / math.pi)
        motion.append(f"spins {_numbers(turns, 2)} times a second")
    when = f"; when it is let go it {' and '.join(motion)}" if motion else ""
    way = "" if table.hand is None else f"{table.hand.phrase}, "
    ranges = (table.height, table.speed, table.spin)
    differ = any(isinstance(value, tuple) for value in ranges)
    each = "; of a range, each throw has a value of its own" if differ else ""
    bounce = (
        f"A corner that hits the table bounces off with {100.0 * table.restitution:.3g} % of "
        "its speed"
        if table.restitution > 0.0
        else "It does not bounce"
    )
    drag = ", and it turns as slowly as in honey" if table.drag > 0.0 else ""
    return (
        f"The odds of this die are for throws {way}in which it {fall}{when}{each}. {bounce}; the "
        f"coefficient of friction is {table.friction:.3g}{drag}. The die is "
        f'{1000.0 * table.size:.3g} mm across. This is the table "{table.name}": '
        f"{table.source}."
    )


def _verdict(simulated: SimulatedThrows) -> Iterator[str]:
    low, high = simulated.interval
    engine = ENGINES[simulated.engine]
    yield (
        f"In {simulated.drops:,} throws that the design had not seen, simulated by "
        f"{engine.phrase or engine.title}, the outcomes' frequencies differ from the target by a "
        f"total variation of {simulated.total_variation:.4f}: no bet on these throws was won "
        "more or less often than it should be by more than that. A perfect die would show "
        f"{simulated.noise_floor:.4f} on the mean in as many throws, by chance alone."
    )
    if low > 0.0:
        yield f"So its odds are off by {low:.4f} to {high:.4f}, with a confidence of 95 %."
    else:
        yield (
            "So the throws do not tell it from a perfect one; with a confidence of 95 % its odds "
            f"are off by at most {high:.4f}."
        )
    if simulated.unresolved:
        yield f"{simulated.unresolved:,} throws did not come to rest on a facet in time."
    elsewhere = simulated.drops - simulated.unresolved - sum(simulated.counts)
    if elsewhere > 0:
        yield f"{elsewhere:,} came to rest on a facet without a label."


def _elsewhere(others: OtherTables) -> str:
    """What the die does on what the table may be instead."""
    return (
        f"Tables are known from throws of real dice, so not for certain: {len(others.values)} "
        "others explain them as well. On nine in ten of these the total variation is at most "
        f"{others.often:.4f}, on the worst {others.worst:.4f}, by {others.drops:,} throws onto all "
        "together, from which the odds on each are fitted. Of a perfect die, which has the same "
        f"odds on all of them, so many throws would show {others.chance_often:.4f} and "
        f"{others.chance_worst:.4f}."
    )
