"""Stage export: the die in millimetres, and its file without labels."""

from __future__ import annotations

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

__all__ = ["export"]


def export(work: Work) -> None:
    """Bring the die to its size, clean a surface for printing, and make die_plain.stl."""
    from dicedesign.fabricate.die import make_solid
    from dicedesign.geometry.meshes.formats import stl_bytes

    work.solid = make_solid(work.die, work.recipe.size_mm)
    work.notes += work.solid.changes
    work.files["die_plain.stl"] = stl_bytes(work.solid.points, work.solid.triangles)


STAGES.register(
    Stage(
        name="export",
        line="brings the die to its size and makes die_plain.stl",
        rank=40,
        wanted=lambda work: True,
        run=export,
    )
)
