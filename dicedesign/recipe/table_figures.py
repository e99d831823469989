"""Pictures of a die on a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dicedesign.kernels import ops as kernels
from dicedesign.recipe.on_table import TableVerdict

__all__ = ["table_figures"]


def table_figures(summary: Mapping[str, Any], verdict: TableVerdict) -> dict[str, bytes]:
    """Bars of odds, the rounds of the design where there were some, and a throw as a strip and as a
    moving picture where the package's own simulator is there. summary: the content of result.json.
    """
    from dicedesign.report.charts.png import png_bytes
    from dicedesign.report.figures.table_odds import refinement_figure, table_odds_figure
    from dicedesign.report.figures.throw_film import film_strip_figure, moving_picture
    from dicedesign.throws.simulation.film import throw_film

    thrown = summary["thrown"]
    target, geometric = np.array(summary["target"]), np.array(summary["probabilities"])
    bars = table_odds_figure(summary["labels"], target, geometric, thrown)
    images = {"table": png_bytes(bars)}
    if verdict.rounds:
        images["rounds"] = png_bytes(refinement_figure(thrown))
    solid = verdict.solid
    if kernels.compiled is not None and solid.triangles is not None:
        film = throw_film(verdict.body, verdict.table)
        shape = solid.points, solid.triangles, verdict.center_of_mass
        images["film"] = png_bytes(film_strip_figure(film, *shape))
        images["throw"] = moving_picture(film, *shape)
    return images
