"""Use custom coordinates: any torch function from parameters to points is a family of dice.

This family is spindles: a ring of sides around an axis, with a tip at each end. The parameters are
the widths of the sides and their distances from the axis.

    python examples/own_coordinates.py
"""

from __future__ import annotations

import torch

import dicedesign as dd

SIDES = 5
TARGET = torch.tensor([0.3, 0.1, 0.25, 0.15, 0.2], dtype=torch.float64)


def spindle(parameters: torch.Tensor) -> torch.Tensor:
    """(2 SIDES + 2, 3) corners, for logarithms (2 SIDES,) of widths and distances."""
    widths = 2.0 * torch.pi * torch.softmax(parameters[:SIDES], 0)
    angles = torch.cumsum(widths, 0) - widths / 2.0
    distances = torch.exp(parameters[SIDES:])
    # Neighboring sides intersect at the corners.
    normals = torch.stack([torch.cos(angles), torch.sin(angles)], dim=1)
    pairs = torch.stack([normals, normals.roll(-1, 0)], dim=1)
    corners = torch.linalg.solve(pairs, torch.stack([distances, distances.roll(-1)], dim=1))
    high = torch.full((SIDES, 1), 1.0, dtype=torch.float64)
    tips = torch.tensor([[0.0, 0.0, 4.0], [0.0, 0.0, -4.0]], dtype=torch.float64)
    return torch.cat([torch.hstack([corners, high]), torch.hstack([corners, -high]), tips])


def probabilities_by_side(parameters: torch.Tensor) -> torch.Tensor:
    """(SIDES,) probabilities of the sides, in their order around the axis."""
    normals, probabilities = dd.differentiable_rest(spindle(parameters))
    around = torch.atan2(normals[:, 1], normals[:, 0]).detach() % (2.0 * torch.pi)
    sides = probabilities[torch.argsort(around)]
    if len(sides) != SIDES:
        raise RuntimeError(f"expected a rest on each of {SIDES} sides, got {len(sides)} rests")
    return sides


def main() -> None:
    """Run Newton's method with the Jacobian of `torch.func` and least-norm steps."""
    parameters = torch.zeros(2 * SIDES, dtype=torch.float64)
    jacobian = torch.func.jacrev(probabilities_by_side)
    for step in range(6):
        errors = probabilities_by_side(parameters) - TARGET
        print(f"step {step}: largest |p - q| {errors.abs().max():.1e}")
        move = torch.linalg.lstsq(jacobian(parameters), errors, driver="gelsd").solution
        parameters = parameters - move / max(1.0, 5.0 * float(move.abs().max()))


if __name__ == "__main__":
    main()
