"""Both rests beside a saddle equally far from it (eq. 20, 21)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["USUAL_INEQUALITY", "asymmetry_residuals"]

USUAL_INEQUALITY: Final = 0.4
"""Root of the weighted sum of the squares of ordinary saddles' relative differences of angles."""


def asymmetry_residuals(die: BearingFacets) -> Tensor:
    """2 phi - 1 of every saddle, with the sign that makes it smooth, by the root of its weight in
    rho, which counts the lowest saddle of each border alone."""
    import torch

    rests, basins = die.rests, die.rests.paths.basins
    normals = rests.rest_normals[torch.as_tensor(basins)]
    saddles = rests.saddle_directions[:, None]
    cross = torch.linalg.cross(normals, saddles.expand_as(normals))
    angles = torch.atan2(torch.linalg.vector_norm(cross, dim=-1), (normals * saddles).sum(-1))
    weights = torch.as_tensor(rests.odds[basins].min(axis=1))
    unequal = (angles[:, 0] - angles[:, 1]) / angles.sum(dim=1)
    return torch.sqrt(weights) * unequal / USUAL_INEQUALITY


PREFERENCES.register(
    Preference(
        name="asymmetry",
        line="both rests beside a saddle equally far from it (eq. 20, 21)",
        rank=2,
        residuals=asymmetry_residuals,
    )
)
