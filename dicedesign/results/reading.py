"""The result in a folder that a run left, read back."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from dicedesign.errors import InputError
from dicedesign.results.record import RESULT, Result
from dicedesign.runtime.files import read_file
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

__all__ = ["read_result"]


def read_result(folder: Path | str) -> Result:
    """The result in a folder that a run left.

    Raises InputError: no run left that folder, or its result.json is damaged.
    """
    from pydantic import TypeAdapter, ValidationError

    path = Path(folder) / RESULT
    try:
        result = TypeAdapter(Result).validate_json(read_file(path, "a result"))
        _check(result)
        result = dataclasses.replace(result, folder=Path(folder))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"]) or "the file"
            reason = f"{key}: {first['msg']}"
        else:
            reason = getattr(error.__cause__, "strerror", None) or str(error)
        raise InputError(
            f"{path}: expected the result of a finished run, got {reason}; name a folder that "
            "`dicedesign run` left, or run its recipe.yaml again"
        ) from error
    return result


def _check(result: Result) -> None:
    """Raise ValueError where labels, odds and facets do not fit together."""
    labels, target = result.labels, np.array(result.target)
    if len(set(labels)) < len(labels) or len(target) != len(labels):
        raise ValueError("labels that are not all different, or not as many as the target's odds")
    if not (target > 0.0).all() or abs(target.sum() - 1.0) > PROBABILITY_SUM_TOLERANCE:
        raise ValueError("a target whose odds are not positive or do not sum to 1")
    lengths = {len(result.center_of_mass), *(len(facet.normal) for facet in result.facets)}
    vectors = np.concatenate([result.center_of_mass, *(facet.normal for facet in result.facets)])
    if lengths != {3} or not np.isfinite(vectors).all():
        raise ValueError("vectors that are not three finite numbers")
    if not {label for label, _ in result.shown} <= set(labels):
        raise ValueError("facets with labels that the die has not")
    if "die_plain" not in result.files:
        raise ValueError("no file of the die")
