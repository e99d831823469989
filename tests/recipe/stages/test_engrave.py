"""Labels cut into made-up dice."""

from __future__ import annotations

import re

import numpy as np
import pytest
from common.made_up_die import SIDES, box, designed

from dicedesign.errors import EngravingError
from dicedesign.recipe.planning.stage import plan
from dicedesign.recipe.planning.work import Work
from dicedesign.results.status import Status
from dicedesign.runtime.arrays import Floats


def engraved(size_mm: float = 25.0, center_of_mass: Floats | None = None) -> Work:
    """A run up to the stage engrave of a box that is no fair die."""
    work = designed(
        box(4.0, 5.0, 6.0),
        SIDES,
        Status.NO_PROGRESS,
        {"fair": 6, "labels": list("abcdef")},
        {"engrave": True, "size_mm": size_mm},
        center_of_mass=center_of_mass,
    )
    plan(work, after="design", last="engrave")
    return work


@pytest.mark.parametrize("depth_mm", [0.3, 3.0])
def test_what_labels_change_by_more_than_a_twentieth_is_told(depth_mm: float) -> None:
    """Of a frustum, which seldom rests on its top: a label deep in the base is worth much there."""
    frustum = box(4.0, 4.0, 2.5)
    frustum[frustum[:, 2] > 0.0] *= [0.3, 0.3, 1.0]
    options = {"depth_mm": depth_mm, "max_height_mm": 20.0, "min_height_mm": 1.0}
    work = designed(
        frustum,
        np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]),
        Status.NO_PROGRESS,
        {"fair": 2, "labels": ["■", "1"]},
        {"engrave": options},
    )
    plan(work, after="design", last="engrave")
    assert work.engraved is not None
    verdict = work.engraved.verdict
    assert verdict is not None
    changes = np.abs(verdict.outcomes.odds / work.plain.outcomes.odds - 1.0)
    assert (changes.max() > 0.05) == (depth_mm > 1.0)
    told = [re.search(r"odds of (\S+) by (\d+)%", note) for note in work.notes]
    if depth_mm < 1.0:
        assert told == []
        return
    (found,) = told
    assert found is not None
    assert found[1] == ("■", "1")[int(changes.argmax())]
    assert int(found[2]) == round(100.0 * changes.max())


def test_labels_lie_on_the_facets_that_outcomes_rest_on() -> None:
    work = engraved()
    assert work.engraved is not None
    for label, side, placement in zip("abcdef", SIDES, work.engraved.placements, strict=True):
        assert placement.text == label
        np.testing.assert_allclose(placement.frame[:3, 2], side, atol=1e-9)
    assert "die.stl" in work.files
    assert any("with the labels cut in" in remark for remark in work.remarks)
    assert set(work.details) >= {"engraved_probabilities", "engraved_max_abs_error"}


def test_with_a_center_that_was_given_nobody_knows_what_labels_change() -> None:
    work = engraved(center_of_mass=np.zeros(3))
    assert work.engraved is not None
    assert work.engraved.verdict is None
    assert "engraved_probabilities" not in work.details
    assert "die.stl" in work.files


def test_labels_without_room_are_an_error_on_good_dice_only() -> None:
    fair = designed(box(1.0, 1.0, 1.0), entries={"engrave": True, "size_mm": 3.0})
    with pytest.raises(EngravingError):
        plan(fair, after="design", last="engrave")
    work = engraved(size_mm=3.0)
    assert work.engraved is None
    assert work.remarks[-1].startswith("not engraved: ")
    assert "die.stl" not in work.files


def test_one_label_without_a_rest_keeps_the_die_plain() -> None:
    directions = SIDES.copy()
    directions[5] = [0.8, 0.6, 0.0]
    target = {"fair": 6, "labels": list("abcdef")}
    work = designed(box(4.0, 5.0, 6.0), directions, Status.NO_PROGRESS, target, {"engrave": True})
    plan(work, after="design", last="engrave")
    assert (work.plain.outcomes.main < 0).sum() == 1
    assert work.engraved is None
    assert "label 'f'" in work.remarks[-1]
    assert "die.stl" not in work.files
