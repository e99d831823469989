"""Sizes at which labels of given designs fit."""

from __future__ import annotations

from typing import Any

import pytest
from common.made_up_die import SIDES, box, designed

from dicedesign.errors import EngravingError
from dicedesign.fabricate.die import make_solid
from dicedesign.fabricate.engraving import place_on_facets
from dicedesign.recipe.pipeline import Work, run_stages


def sized_work(
    size_mm: float, engrave: bool = True, enlarge: bool = True, label: str = "6", thin: float = 4.0
) -> Work:
    """Run up to the stage "size" of a box with a label on a facet with its smallest side."""
    entries = {"engrave": engrave, "size_mm": size_mm}
    target = {"fair": 6, "labels": ["1", "2", "3", "4", "5", label]}
    work = designed(box(thin, 5.0, 6.0), target=target, entries=entries)
    work.enlarge = enlarge
    run_stages(work, after="design", last="size")
    return work


def fits(work: Work, size_mm: float) -> bool:
    assert work.recipe.engrave is not None
    try:
        solid = make_solid(work.die, size_mm)
        place_on_facets(
            solid.poses,
            solid.outcomes.main,
            solid.poses.hull,
            work.target.labels,
            work.recipe.engrave,
        )
    except EngravingError:
        return False
    return True


def test_the_size_is_the_smallest_whole_number_of_millimeters() -> None:
    work = sized_work(5.0)
    size = work.recipe.size_mm
    assert size == int(size) > 5.0
    assert fits(work, size)
    assert not fits(work, size - 1.0)
    assert len(work.notes) == 1
    assert f"{size:g}" in work.notes[0]
    assert "rare outcomes" not in work.notes[0]
    assert work.recipe.engrave is not None


@pytest.mark.parametrize(
    "options", [{"size_mm": 30.0}, {"engrave": False}, {"enlarge": False}], ids=str
)
def test_a_sufficient_size_is_kept(options: dict[str, Any]) -> None:
    work = sized_work(**{"size_mm": 5.0, **options})
    assert work.recipe.size_mm == options.get("size_mm", 5.0)
    assert work.notes == []


def test_a_size_that_does_not_help_is_kept() -> None:
    """The label needs more than the largest size, or a missing facet."""
    huge = sized_work(30.0, label="not so short", thin=0.02)
    assert (huge.recipe.size_mm, huge.notes) == (30.0, [])
    lacking = designed(box(4.0, 5.0, 6.0), SIDES, target={"fair": 6}, entries={"engrave": True})
    lacking.enlarge = True
    directions = SIDES.copy()
    directions[5] = [0.8, 0.6, 0.0]
    lacking.die = designed(box(4.0, 5.0, 6.0), directions, target={"fair": 6}).die
    run_stages(lacking, after="design", last="size")
    assert (lacking.recipe.size_mm, lacking.notes) == (30.0, [])
