"""Figures of the report of a finished die, in the order of the page.

Modules that draw are imported late, as importing matplotlib takes half a second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from dicedesign.kernels import ops as kernels
from dicedesign.report.paper import PAGE_WIDTH, REPORT_DPI
from dicedesign.runtime.registry import Extension, Registry

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

MAX_FLAT_TRIANGLES = 400
"""Most triangles of a mesh that is drawn with flat faces and edges."""


def draw_by_address(address: str, *arguments: Any, **options: Any) -> Any:
    """Call a function of this package, "module:name"."""
    return resolve_name(f"dicedesign.report.{address}")(*arguments, **options)


@dataclass(frozen=True, kw_only=True)
class Figure(Extension):
    """Figure of the report; `name` is the name of its file without the ending.

    Attributes
    ----------
    title, caption: texts above and below the figure on the page.
    wanted: whether the figure applies to a die.
    draw: makes the content of the file.
    suffix: ending of the file, ".png" or ".gif".
    instead_of: name of a figure that this one replaces on the page, or empty.
    part: part of the page: "reading", "research", or empty for the figures of the die.
    """

    title: str
    caption: str
    wanted: Callable[[FinishedDie], bool]
    draw: Callable[[FinishedDie], bytes]
    suffix: str = ".png"
    instead_of: str = ""
    part: str = ""


def _whole(die: FinishedDie) -> tuple[Any, ...]:
    return (die,)


def _result(die: FinishedDie) -> tuple[Any, ...]:
    return (die.result,)


def _figure(
    name: str,
    address: str,
    wanted: Callable[[FinishedDie], bool],
    line: str,
    title: str,
    caption: str,
    arguments: Callable[[FinishedDie], tuple[Any, ...]] = _whole,
    **more: str,
) -> Figure:
    """Figure that a function of this package, "module:name", draws as wide as the page.

    arguments: of the function.
    """

    def draw(die: FinishedDie) -> bytes:
        from dicedesign.report.sheet import figure_bytes

        figure = draw_by_address(address, *arguments(die), width=PAGE_WIDTH)
        return figure_bytes(figure, ".png", REPORT_DPI)

    return Figure(
        name=name, line=line, title=title, caption=caption, wanted=wanted, draw=draw, **more
    )


def _is_reshaped(die: FinishedDie) -> bool:
    return die.reshaped is not None


def _is_convex(die: FinishedDie) -> bool:
    return die.reshaped is None


def _can_be_filmed(die: FinishedDie) -> bool:
    """Whether a die was designed for a table, has a mesh, and our simulator is compiled."""
    thrown = die.thrown
    has_mesh = thrown is not None and thrown.die.solid.triangles is not None
    return has_mesh and kernels.available()


MIN_HANDS = 2
"""Number of energies above which a parabola means anything."""


def _has_several_hands(die: FinishedDie) -> bool:
    """Whether a die was thrown onto a mixture whose throws have different energies."""
    if die.thrown is None or die.result.thrown is None or die.result.thrown.by_table is None:
        return False
    return len({table.energy for table in die.thrown.die.tables}) > MIN_HANDS


FIGURES = Registry(
    "figure",
    Figure,
    builtin=[
        _figure(
            "rests",
            "surface_figures:rests",
            _is_reshaped,
            "the die at rest after each outcome",
            "The die at rest after each outcome",
            "Above, the die on a table, with the outcome and its probability; where outcomes have "
            "several poses, with the probability of the pose and those like it. Below, its "
            "underside, seen when the die is tipped backward. The colored places touch the table: "
            "facets of its convex hull, in the color of their outcome.",
            part="reading",
        ),
        _figure(
            "table",
            "bar_charts:table_probabilities",
            lambda die: die.result.thrown is not None,
            "probabilities on the table by each model beside the target",
            "Probabilities on the table",
            "The wide bar behind each outcome is its target. The narrow bars show how often the "
            "outcome comes up: without momentum, by the momentum model (with the range for 95 of "
            "100 prints), and in simulated throws, if any, with a 95 % interval.",
            instead_of="bars",
            arguments=_result,
        ),
        _figure(
            "candidates",
            "solid_figures:candidates",
            lambda die: len(die.result.candidates) > 1,
            "dice with different numbers of faces that were compared",
            "Dice that were compared",
            "Dice with your probabilities and different numbers of faces, at the sizes that their "
            "labels need, the best first. The table below says what distinguishes them; `--pick K` "
            "makes number K.",
        ),
        _figure(
            "repair",
            "surface_figures:repair",
            lambda die: die.repaired is not None,
            "a mesh before and after it was repaired",
            "Repair",
            "Above, the original mesh; edges that do not join two triangles are red. Below, the "
            "repaired surface. All views have the same scale.",
            arguments=lambda die: (die.repaired, die.upward),
        ),
        _figure(
            "rounds",
            "curve_charts:rounds",
            lambda die: die.result.thrown is not None and len(die.result.thrown.rounds) > 0,
            "deviation from the target after each round of simulated throws",
            "Round by round",
            "After each round of simulated throws the die was designed again, to correct the "
            "measured deviation. The deviation in a round's own throws includes chance: the dashed "
            "line is what a perfect die would show. The expected deviation of a die uses the "
            "throws of all rounds, and the die with the least is kept. Triangles, if any, are "
            "the deviation that nine in ten hands are expected to see at most.",
            part="research",
            arguments=_result,
        ),
        _figure(
            "hands",
            "curve_charts:hands",
            _has_several_hands,
            "probabilities of the outcomes from gentle to quick hands",
            "From gentle to quick hands",
            "Each column of points is one hand: how often the outcomes come up if somebody throws "
            "the die with this energy. One is a fall from a height of one die. Curves that are "
            "level are the same for every hand; dashed lines are the targets.",
        ),
        Figure(
            name="throw",
            line="a throw as a moving picture",
            title="A throw",
            caption="A simulated throw of typical length, in slow motion.",
            wanted=_can_be_filmed,
            draw=lambda die: draw_by_address("motion_pictures:throw", die),
            suffix=".gif",
        ),
        _figure(
            "before_after",
            "surface_figures:reshaped",
            _is_reshaped,
            "the surface before and after it was made into a die",
            "Before and after",
            "Above, the original surface; below, the die made of it. All views have one scale.",
        ),
        _figure(
            "bars",
            "bar_charts:probabilities",
            _is_convex,
            "target probabilities beside the achieved ones",
            "Target and achieved probabilities",
            "The probability of each label of the die as designed (achieved, die_plain.stl), in "
            "the color of its outcome. The wide bar behind it is your target. The thin lines show "
            "the range for 95 of 100 prints.",
            arguments=_result,
        ),
        _figure(
            "probabilities",
            "bar_charts:reshaped_probabilities",
            lambda die: die.result.concave is not None,
            "probabilities before and after the surface was made into a die",
            "Probabilities before and after",
            "Probability that the body comes to rest on each outcome, and on any other side "
            "(elsewhere), before and after it was made into a die. The wide bar behind each "
            "outcome is its target.",
            arguments=_result,
        ),
        _figure(
            "hull",
            "surface_figures:hull",
            _is_reshaped,
            "the die within its convex hull",
            "The die within its convex hull",
            "A body rolls like its convex hull. The die rests on the colored facets, one color for "
            "each outcome; those on the far side are paler.",
        ),
        _figure(
            "trade_off",
            "curve_charts:trade_off",
            lambda die: (
                die.result.search is not None and len(die.result.search.trade_off.drafts) > 0
            ),
            "displacement against probabilities of each attempt at a concave die",
            "Displacement and error of the attempts",
            "Best die of each attempt, by number: how far the surface was moved, and how far its "
            "probabilities are from the target, all other rests included. The mark shows its worst "
            "flaw.",
            part="research",
            arguments=_result,
        ),
        _figure(
            "convergence",
            "curve_charts:history",
            _is_convex,
            "error and energy of the design against run time, or steps",
            "Course of the design",
            "Largest difference of a probability from its target, and the energy, after each step.",
            part="research",
            arguments=lambda die: (die.result, die.tolerance),
        ),
        _figure(
            "displacement",
            "surface_figures:displacement",
            _is_reshaped,
            "how far each part of the surface was moved",
            "How far the surface was moved",
            "Distance of each point from its place on the original surface, relative to the "
            "diagonal of that surface's bounding box.",
        ),
        _figure(
            "crossings",
            "surface_figures:crossings",
            lambda die: die.quality is not None and len(die.quality.intersections) > 0,
            "where the surface intersects itself",
            "Where the surface intersects itself",
            "Intersecting triangles are red.",
        ),
        _figure(
            "energy",
            "curve_charts:history",
            lambda die: die.reshaped is not None and len(die.result.history) > 0,
            "energy and error of a design of several stages against run time, or steps",
            "Energy of each stage",
            "Each stage lowers an energy of its own. The error, the largest difference of a "
            "probability from its target, is drawn where it was computed.",
            part="research",
            arguments=lambda die: (die.result, die.tolerance),
        ),
        _figure(
            "gauss_map",
            "gauss_map:gauss_map",
            _is_convex,
            "directions of the die by the facet that it comes to rest on",
            "Where the die ends up",
            "Each area is one face, in the color of its outcome. A larger area means a more likely "
            "face. Each point is a direction of the die that points down when it is let go without "
            "momentum. The thick lines (separatrices) divide the areas. At a saddle the die can "
            "fall to either side of an edge; at a maximum it balances on a corner.",
            arguments=lambda die: (
                die.plain.poses,
                die.result.labels,
                die.plain.outcomes.outcome_of_rest,
            ),
        ),
        _figure(
            "views",
            "solid_figures:views",
            _is_convex,
            "the die from several sides",
            "The die from several sides",
            "All views have one scale.",
            arguments=lambda die: (die.printed.points, die.printed.triangles),
        ),
        _figure(
            "reading",
            "solid_figures:reading",
            lambda die: die.engraved is not None and die.reading is not None,
            "the die at rest, and the label to read",
            "How to read the die",
            "The die at rest after one outcome, and the label to read.",
            part="reading",
        ),
        _figure(
            "faces",
            "solid_figures:faces",
            lambda die: die.engraved is not None and len(die.engraved.placements) > 0,
            "every face flat and true to scale, with its label as it is cut",
            "Every face",
            "The line above each face gives its label and how often that comes up. On a die that "
            "is read around its top corner each face has several labels. All faces have one scale; "
            "rounded edges are left out.",
        ),
        _figure(
            "print_orientation",
            "solid_figures:print_orientation",
            lambda die: die.result.printability is not None,
            "the die in its best print orientation, and the parts that need supports",
            "Best orientation on the print bed",
            "Blue is on the bed, red needs supports.",
        ),
    ],
    group="dicedesign.figures",
)
"""Figures of dice, in the order of the page."""


def figure_files(
    die: FinishedDie, on_figure: Callable[[int, int, str], object]
) -> dict[str, bytes]:
    """Contents of the files of all figures that apply to a die, by name of the figure.

    on_figure: called before each with the numbers of finished ones and of all, and "figures".
    """
    wanted, files = [figure for figure in FIGURES if figure.wanted(die)], dict[str, bytes]()
    for figure in wanted:
        on_figure(len(files), len(wanted), "figures")
        files[figure.name] = figure.draw(die)
    return files
