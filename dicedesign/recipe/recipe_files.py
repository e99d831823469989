"""Files that the run of a recipe reads and may write."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from dicedesign.recipe.reading import recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.folder import CHECKPOINT, PAGE, RECIPE, SOLIDS
from dicedesign.results.result import RESULT
from dicedesign.runtime.outputs import checksum, file_checksum


def output_names(recipe: Recipe, folder: Path) -> list[str]:
    """Names of the files that a run of a recipe may write into a folder, or remove.

    A recipe there with the same text stays as it is, and is left out.
    """
    names = [*SOLIDS, RESULT, CHECKPOINT]
    names += [f"{stem}.{kind}" for kind in recipe.files for stem in ("die", "die_plain")]
    if recipe.report:
        names.append(PAGE)
    if recipe.figures:
        from dicedesign.report.figures import FIGURES

        names += [f"{figure.name}{figure.suffix}" for figure in FIGURES]
    if file_checksum(folder / RECIPE) != checksum(recipe_text(recipe).encode()):
        names.append(RECIPE)
    return names


def input_files(recipe: Recipe) -> list[Path]:
    """Files that a recipe names."""

    def texts(value: object) -> list[str]:
        if isinstance(value, Mapping):
            value = list(value.values())
        if isinstance(value, list | tuple):
            return [text for each in value for text in texts(each)]
        return [value] if isinstance(value, str) else []

    return [Path(text) for text in texts(recipe.as_dict()) if os.path.isfile(text)]
