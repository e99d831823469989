"""What the stages hand on, and what becomes of it in a result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.made_up_die import SIDES, box, checked

from dicedesign.results.parts import Status
from dicedesign.results.result import Designed, HullsMade


def test_a_result_says_what_the_work_holds() -> None:
    """Of a box that has a label on three of its sides."""
    work = checked(box(4.0, 5.0, 6.0), SIDES[:3], Status.NO_PROGRESS, {"fair": 3})
    work.notes.append("a note")
    work.extra |= {"grams": 2.5}
    work.die = replace(work.die, starts=5, evaluations=9, hulls=HullsMade(4, 2))
    result = work.result()
    assert (result.status, result.message) == ("no_progress", "; ".join(work.remarks))
    assert result.extra == {"grams": 2.5}
    assert result.design == Designed(work.design_error, None, 5, 9, HullsMade(4, 2))
    assert result.notes == ("a note",)
    assert result.unstable_facets == 0
    assert result.rest_counts == (1, 1, 1)
    assert result.least_angle_deg == pytest.approx(90.0, abs=1e-5)
    # From its smallest side over one of the longer edges.
    assert result.least_margin_deg == pytest.approx(np.degrees(np.arctan(4.0 / 6.0)), abs=1e-4)
    assert result.elsewhere == pytest.approx(0.5, abs=1e-6)
    assert (result.folder, result.files) == (None, {})
    work.die = replace(work.die, terms={"dice": 0.25})
    assert work.result().design.energy == {"dice": 0.25}


def test_what_is_done_to_a_copy_is_not_done_to_the_work() -> None:
    work = checked(box(4.0, 5.0, 6.0))
    before = [len(work.remarks), len(work.notes), len(work.extra), len(work.files)]
    stages = len(work.clock.stages)
    twin = work.copy()
    assert twin.result() == work.result()
    twin.remarks.append("more")
    twin.notes.append("more")
    twin.extra["more"] = 1
    twin.files["more"] = twin.images["more"] = b""
    with twin.clock.stage("more"):
        pass
    assert [len(work.remarks), len(work.notes), len(work.extra), len(work.files)] == before
    assert (len(work.clock.stages), work.images) == (stages, {})
