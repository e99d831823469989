"""What a page says of printing."""

from __future__ import annotations

from dataclasses import replace

from common.made_up_die import SIDES, box, checked
from common.parsed_html import parsed

from dicedesign.recipe.pipeline import run_stages
from dicedesign.report.pages.die_page import die_page
from dicedesign.report.pages.printability import printability_sections
from dicedesign.results.parts import PrintedLabel


def test_a_page_has_the_measures_of_the_print() -> None:
    work = checked(box(1.0, 1.0, 1.0), SIDES, entries={"engrave": True, "print": "sla"})
    run_stages(work, after="check", last="printing")
    result = work.result()
    found = result.printability
    assert found is not None
    page = parsed(die_page(result, {}))
    for cell in (
        "SLA, 0.05 mm, layers of 0.05 mm",
        f"{found.weight_g:.3g} g of resin, 1.15 g/cm³, solid",
        "17.3 × 17.3 × 17.3 mm",
        "nothing",
        "one closed solid without a flaw",
    ):
        assert cell in page.cells
    for label in found.labels:
        assert label.text in page.cells
        assert f"{label.wall_mm:.2g}" in page.cells
    assert "Printing" not in parsed(die_page(replace(result, printability=None), {})).text


def test_what_is_missing_is_a_dash_and_texts_are_escaped() -> None:
    work = checked(box(1.0, 1.1, 1.2), SIDES, entries={"engrave": False})
    run_stages(work, after="check", last="printing")
    found = work.result().printability
    assert found is not None
    concave = replace(
        found,
        smallest_facet=None,
        labels=(PrintedLabel("<7>", None, None, None),),
        best=replace(found.best, overhang_mm2=12.34, support_mm3=3.14, label="<7>"),
        file=replace(found.file, open_edges=3),
    )
    page = parsed("".join(printability_sections(concave)))
    assert page.cells.count("-") == 3
    assert "<7>" in page.cells
    assert "12.3 mm², 3 mm³ beneath" in page.cells
    assert "3 open edges" in page.text
    assert "Printed as it rests" not in page.text
