"""Figures of the report of a finished die, in the order of the page.

What draws them is imported when they are drawn: it takes matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Final

from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie


@dataclass(frozen=True, kw_only=True)
class Figure(Extension):
    """A figure; `name` is that of its file, without the ending.

    Attributes
    ----------
    title, caption: above and below it on the page.
    wanted: whether a die has it.
    draw: the content of its file.
    suffix: ending of its file, ".png" or ".gif".
    instead_of: name of a figure that is not shown on the page where this one is, or empty.
    """

    title: str
    caption: str
    wanted: Callable[[FinishedDie], bool]
    draw: Callable[[FinishedDie], bytes]
    suffix: str = ".png"
    instead_of: str = ""


def _sheet(address: str) -> Callable[[FinishedDie], bytes]:
    """The PNG of the sheet that a function of this room draws, "module:name"."""
    module, _, name = address.partition(":")

    def draw(die: FinishedDie) -> bytes:
        drawn: bytes = getattr(import_module(f"dicedesign.report.{module}"), name)(die).png()
        return drawn

    return draw


def _is_reshaped(die: FinishedDie) -> bool:
    return die.reshaped is not None


def _is_convex(die: FinishedDie) -> bool:
    return die.reshaped is None


def _has_drafts(die: FinishedDie) -> bool:
    search = die.result.search
    return search is not None and len(search.trade_off.drafts) > 0


def _can_be_filmed(die: FinishedDie) -> bool:
    """Whether a die is thrown, as a mesh, where the package's own simulator is there."""
    from dicedesign.kernels import ops as kernels

    thrown = die.thrown
    has_mesh = thrown is not None and thrown.die.solid.triangles is not None
    return has_mesh and kernels.available()


def _draw_throw(die: FinishedDie) -> bytes:
    from dicedesign.report.throw_pictures import throw

    return throw(die)


RESTS = Figure(
    name="rests",
    line="the die as it lies after each outcome",
    title="How the die lies after each outcome",
    caption=(
        "Above, the die on a table, with the outcome and its probability; below, its underside, as "
        "seen when the die is tipped backward. Coloured are the facets of its convex hull that it "
        "rests on, in the colour of their outcome."
    ),
    wanted=_is_reshaped,
    draw=_sheet("surface_figures:rests"),
)

TABLE = Figure(
    name="table",
    line="odds on the table by each model beside the target",
    title="Odds on the table",
    caption=(
        "The wide bar behind each outcome is its target. In front of it is how often the die would "
        "show it if it rolled without momentum, how often the momentum model expects it of it and "
        "of its prints, and, where throws were simulated, how often it came up, with the interval "
        "that chance allows."
    ),
    wanted=lambda die: die.result.thrown is not None,
    draw=_sheet("bar_charts:table_chart"),
    instead_of="bars",
)

REPAIR = Figure(
    name="repair",
    line="a mesh before and after it was repaired",
    title="Repair",
    caption=(
        "The mesh as it came, above, red at edges that are not of two triangles, and the surface "
        "that was made of it, below; all views have the same scale."
    ),
    wanted=lambda die: die.repaired is not None,
    draw=_sheet("surface_figures:repair"),
)

ROUNDS = Figure(
    name="rounds",
    line="deviation from the target after each round of simulated throws",
    title="Round by round",
    caption=(
        "After each round of simulated throws the die was designed anew, to make up for what was "
        "seen. A round's own throws show its die with as much of chance in it as a perfect die "
        "would show, the dashed line. What is expected of each die rests on the throws of all "
        "rounds; that with the least is kept. Triangles, if any, are what is expected on nine of "
        "ten tables that the table may be instead."
    ),
    wanted=lambda die: die.result.thrown is not None and len(die.result.thrown.rounds) > 0,
    draw=_sheet("curve_charts:rounds_chart"),
)

THROW = Figure(
    name="throw",
    line="a throw as a moving picture",
    title="A throw",
    caption="A simulated throw of typical length, in slow motion.",
    wanted=_can_be_filmed,
    draw=_draw_throw,
    suffix=".gif",
)

BEFORE_AFTER = Figure(
    name="before_after",
    line="the surface before and after it was made into a die",
    title="Before and after",
    caption=(
        "The surface as it came, above, and as it was made into a die, below; all views have the "
        "same scale."
    ),
    wanted=_is_reshaped,
    draw=_sheet("surface_figures:before_after"),
)

FILM = Figure(
    name="film",
    line="a throw at several moments",
    title="The same throw in pictures",
    caption=(
        "With the time since the die was let go. The camera goes along with the die; the farther "
        "the shadow is below it, the higher it is in the air."
    ),
    wanted=_can_be_filmed,
    draw=_sheet("throw_pictures:film"),
)

BARS = Figure(
    name="bars",
    line="target odds beside the achieved ones",
    title="Target and achieved odds",
    caption=(
        "Probability that the die comes to rest on the facet with each label; the lines hold that "
        "of 95 % of its prints."
    ),
    wanted=_is_convex,
    draw=_sheet("bar_charts:bars_chart"),
)

ODDS = Figure(
    name="odds",
    line="odds before and after the surface was made into a die",
    title="Odds before and after",
    caption=(
        "Probability that the body comes to rest on each outcome, and on any other side "
        "(elsewhere), before and after it was made into a die. The wide bar behind each outcome is "
        "its target."
    ),
    wanted=lambda die: die.result.concave is not None,
    draw=_sheet("bar_charts:before_after_chart"),
)

HULL = Figure(
    name="hull",
    line="the die within its convex hull",
    title="The die within its convex hull",
    caption=(
        "A body rolls like its convex hull, which touches the table. Coloured are the facets that "
        "the die rests on, by outcome; those on the far side are paler."
    ),
    wanted=_is_reshaped,
    draw=_sheet("surface_figures:hull"),
)

TRADE_OFF = Figure(
    name="trade_off",
    line="displacement against odds of each attempt at a concave die",
    title="What the attempts led to",
    caption=(
        "Best die of each attempt, by its number: how far the surface was moved, and how far its "
        "odds are from the target, all other rests included. Marks say what is worst of it."
    ),
    wanted=_has_drafts,
    draw=_sheet("curve_charts:trade_off_chart"),
)

CONVERGENCE = Figure(
    name="convergence",
    line="error and energy of the design against run time, or steps",
    title="Course of the design",
    caption="Largest difference of a probability from its target, and the energy, after each step.",
    wanted=_is_convex,
    draw=_sheet("curve_charts:convergence_chart"),
)

DISPLACEMENT = Figure(
    name="displacement",
    line="how far each part of the surface was moved",
    title="How far the surface was moved",
    caption=(
        "Distance of each point of the surface from where it was before, relative to the diagonal "
        "of the box that held the surface."
    ),
    wanted=_is_reshaped,
    draw=_sheet("surface_figures:displacement"),
)

CROSSINGS = Figure(
    name="crossings",
    line="where the surface meets itself",
    title="Where the surface meets itself",
    caption="In red the triangles that meet and should not.",
    wanted=lambda die: die.quality is not None and len(die.quality.intersections) > 0,
    draw=_sheet("surface_figures:crossings"),
)

ENERGY = Figure(
    name="energy",
    line="energy and error of a design of several stages against run time, or steps",
    title="Energy of each stage",
    caption=(
        "Each stage lowers an energy of its own. The error, the largest difference of a "
        "probability from its target, is drawn where it was computed."
    ),
    wanted=lambda die: die.reshaped is not None and len(die.result.history) > 0,
    draw=_sheet("curve_charts:energy_chart"),
)

GAUSS_MAP = Figure(
    name="gauss_map",
    line="directions of the die by the facet that it comes to rest on",
    title="Where the die ends up",
    caption=(
        "Every point is a direction of the die that points down when it is let go; its colour "
        "tells on which facet the die comes to rest if it rolls there without momentum."
    ),
    wanted=_is_convex,
    draw=_sheet("gauss_map:gauss_map"),
)

VIEWS = Figure(
    name="views",
    line="the die from several sides",
    title="The die from several sides",
    caption="All views have the same scale.",
    wanted=_is_convex,
    draw=_sheet("solid_figures:views"),
)

READING = Figure(
    name="reading",
    line="the die at rest, and the label that is read then",
    title="How to read the die",
    caption="The die as it lies after one of its outcomes, and the label to read.",
    wanted=lambda die: die.engraved is not None and die.reading is not None,
    draw=_sheet("solid_figures:reading"),
)

FACES = Figure(
    name="faces",
    line="every face flat and true to scale, with its label as it is cut",
    title="Every face",
    caption=(
        "Each face seen straight from outside, all on one scale, with its label as it is cut. "
        "Above it is what it says, and how often that comes up; around a corner on top each face "
        "says several things. Rounded edges are left out."
    ),
    wanted=lambda die: die.engraved is not None and len(die.engraved.placements) > 0,
    draw=_sheet("solid_figures:faces"),
)

PRINT_ORIENTATION = Figure(
    name="print_orientation",
    line="the die as it is best printed, and what needs supports",
    title="How to lay it on the print bed",
    caption="Blue lies on the bed, red needs supports.",
    wanted=lambda die: die.result.printability is not None,
    draw=_sheet("solid_figures:print_orientation"),
)

_NAMES: Final = (
    "RESTS TABLE REPAIR ROUNDS THROW BEFORE_AFTER FILM BARS ODDS HULL TRADE_OFF CONVERGENCE "
    "DISPLACEMENT CROSSINGS ENERGY GAUSS_MAP VIEWS READING FACES PRINT_ORIENTATION"
)

FIGURES: Final = Registry(
    "figure",
    Figure,
    builtin=[f"dicedesign.report.figures:{name}" for name in _NAMES.split()],
    group="dicedesign.figures",
)
"""All figures of dice, in the order of the page."""


def figure_files(die: FinishedDie) -> dict[str, bytes]:
    """The content of the file of each figure that a die has, by the figure's name."""
    return {figure.name: figure.draw(die) for figure in FIGURES if figure.wanted(die)}
