"""What may be said of a print, and the presets behind it."""

from __future__ import annotations

from typing import Any

import pytest

from dicedesign.errors import InputError
from dicedesign.fabricate.print_options import PrintErrors, PrintOptions
from dicedesign.fabricate.printers import MATERIALS, PRINTERS
from dicedesign.recipe.reading import checked_recipe

RECIPE = {"name": "d4", "target": {"fair": 4}}


@pytest.mark.parametrize("name", ["fdm", "sla", "sls"])
def test_presets_are_complete_and_say_where_from(name: str) -> None:
    printer = PRINTERS[name]
    assert set(printer.materials) <= set(MATERIALS)
    assert 0.0 < printer.spot_mm <= printer.groove_mm
    assert printer.layer_mm <= printer.groove_depth_mm <= 1.0
    assert 0.0 < printer.dimensional_error_mm < 1.0
    assert 0.0 <= printer.shrinkage < 0.05
    assert 0.0 <= printer.overhang_deg < 90.0
    # Each names who says so, and when.
    said = " ".join(printer.sources)
    for number in ("wall", "groove", "ridge", "raised", "error", "shrinkage"):
        assert number in said


def test_a_finer_nozzle_draws_finer() -> None:
    usual, fine = PrintOptions().chosen, PrintOptions(nozzle_mm=0.2).chosen
    for name in ("spot_mm", "layer_mm", "wall_mm", "groove_mm", "ridge_mm", "raised_mm"):
        assert getattr(fine, name) == pytest.approx(getattr(usual, name) / 2.0)
    assert fine.overhang_deg == usual.overhang_deg
    assert PrintOptions(nozzle_mm=0.4).chosen == usual


def test_density_is_the_materials_unless_given() -> None:
    assert PrintOptions().density == MATERIALS["pla"].density_g_cm3
    assert PrintOptions(printer="sls").density == MATERIALS["pa12"].density_g_cm3
    assert PrintOptions(material="abs").density == MATERIALS["abs"].density_g_cm3
    assert PrintOptions(material="abs", density_g_cm3=1.5).density == 1.5


@pytest.mark.parametrize(
    ("entries", "named"),
    [
        ({"printer": "cnc"}, "printer: expected fdm, sla, sls, got 'cnc'"),
        ({"nozzle_mm": 0.0}, "nozzle_mm: expected a number above 0 and at most 2, got 0"),
        ({"nozzle_mm": float("nan")}, "nozzle_mm: "),
        ({"nozzle_mm": True}, "nozzle_mm: "),
        ({"printer": "sla", "nozzle_mm": 0.2}, "nozzle_mm: expected a printer with a nozzle"),
        ({"material": "pa12"}, "material: expected pla, petg, abs, asa, pc for fdm, got 'pa12'"),
        ({"density_g_cm3": -1.0}, "density_g_cm3: expected a number above 0"),
    ],
)
def test_bad_options_are_explained(entries: dict, named: str) -> None:
    with pytest.raises(InputError, match=named):
        PrintOptions(**entries)


def test_a_recipe_says_it_in_a_word_or_leaves_it_out() -> None:
    assert checked_recipe(RECIPE).print == PrintOptions()
    assert checked_recipe({**RECIPE, "print": "sla"}).print == PrintOptions(printer="sla")
    assert checked_recipe({**RECIPE, "print": False}).print is None
    given = checked_recipe({**RECIPE, "print": {"printer": "sls", "oriented": True}})
    assert given.print == PrintOptions(printer="sls", oriented=True)
    for recipe in (given, checked_recipe({**RECIPE, "print": False})):
        assert checked_recipe(recipe.resolved()) == recipe
    with pytest.raises(InputError, match=r"print: printer: expected fdm, sla, sls, got 'laser'"):
        checked_recipe({**RECIPE, "print": "laser"})


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"infill": 1.5}, "infill: expected a number from 0 to 1, got 1.5; 0.2 is 20 %"),
        ({"infill": float("nan")}, "infill: expected a number from 0 to 1, got nan"),
        ({"walls_mm": 0.0}, "walls_mm: expected a number from 0.05 to 1000, got 0"),
        ({"walls_mm": 1e-9}, "walls_mm: .* from 0.05 to 1000, got 1e-09"),
        (
            {"walls_mm": float("inf")},
            "walls_mm: .* to 1000, got inf",
        ),
    ],
)
def test_how_to_print(given: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        PrintOptions(**given)
    with pytest.raises(InputError, match="print.*" + text.split(";")[0]):
        checked_recipe({"name": "d", "target": {"fair": 6}, "print": given})


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (
            {"dimensional_mm": -0.1},
            "errors.dimensional_mm: expected a number of at least 0",
        ),
        ({"shrinkage": 0.2}, "errors.shrinkage: expected a number of at least 0 and below 0.2"),
        ({"density_gradient": 0.5}, "errors.density_gradient: .* below 0.5, got 0.5; leave it out"),
        (
            {"bubble_mm3": float("nan")},
            "errors.bubble_mm3: expected a number of at least 0",
        ),
        (
            {"bubble_mm3": True},
            "errors.bubble_mm3: .* below 1e.09, got True",
        ),
        ({"bubble_mm3": 1e9}, "errors.bubble_mm3: .* below 1e.09, got 1000000000.0"),
        ({"dimensional_mm": 1e300}, "errors.dimensional_mm: .* below 1000, got 1e.300"),
    ],
)
def test_what_differs_from_print_to_print(given: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        PrintErrors(**given)


def test_a_recipe_says_how_it_will_be_printed() -> None:
    given: dict[str, Any] = {
        "infill": 0.2,
        "walls_mm": 0.8,
        "errors": {"dimensional_mm": 0.05},
    }
    recipe = checked_recipe({"name": "d", "target": {"fair": 6}, "print": given})
    assert recipe.print == PrintOptions(**(given | {"errors": PrintErrors(dimensional_mm=0.05)}))
    again = checked_recipe(recipe.resolved())
    assert again.print == recipe.print
