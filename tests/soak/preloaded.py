"""What the process has done that commands are forked from: imports, and a recipe that was read."""

from __future__ import annotations

import contextlib
import gc
from importlib import import_module

from dicedesign.recipe.reading import checked_recipe

for _name in (
    "torch",
    "trimesh",
    "manifold3d",
    "dicedesign.cli.rest",
    "dicedesign.cli.rolls",
    "dicedesign.cli.dice",
    "dicedesign.fabricate.engraving",
    "dicedesign.geometry.meshes.reading",
    "dicedesign.recipe.convex",
    "dicedesign.recipe.thrown",
    "dicedesign.recipe.pipeline",
    "dicedesign.throws.goodness_of_fit",
):
    with contextlib.suppress(ImportError):
        import_module(_name)

checked_recipe({"name": "die", "target": {"fair": 3}})

# Children share all of it until they write to it, which the garbage collector would do.
gc.collect()
gc.freeze()
