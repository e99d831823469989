"""Lower a custom energy with `torch.optim`: equalize the resting probabilities of a stone.

python examples/torch_gradient.py
"""

from __future__ import annotations

import torch

import dicedesign as dd


def unevenness(corners: torch.Tensor) -> tuple[torch.Tensor, int]:
    """Return the sum of the squared probabilities, lowest if all are equal, and the rest count."""
    _, probabilities = dd.differentiable_rest(corners)
    return (probabilities**2).sum(), len(probabilities)


def main() -> None:
    """Run sixty steps of Adam from twelve random points on a sphere."""
    torch.manual_seed(0)
    corners = torch.nn.functional.normalize(torch.randn(12, 3, dtype=torch.float64), dim=1)
    corners.requires_grad_()
    optimizer = torch.optim.Adam([corners], lr=0.005)
    for step in range(61):
        optimizer.zero_grad()
        energy, rests = unevenness(corners)
        energy.backward()
        optimizer.step()
        if step % 20 == 0:
            print(f"step {step:3}: {rests} rests, sum of squares {energy.item():.4f}")


if __name__ == "__main__":
    main()
