"""Train a small network whose outputs are dice: asked for probabilities, it answers with the
corners of a tetrahedron that comes to rest with them.

    python examples/train_network.py
"""

from __future__ import annotations

import torch

import dicedesign as dd

REGULAR = torch.tensor([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=torch.float64)


def asked(dice: int) -> torch.Tensor:
    """(dice, 4) random probabilities, the largest first."""
    uneven = torch.softmax(0.35 * torch.randn(dice, 4, dtype=torch.float64), dim=1)
    return uneven.sort(dim=1, descending=True).values


def misses(network: torch.nn.Module, wanted: torch.Tensor) -> torch.Tensor:
    """(dice, 4) differences of the probabilities of a network's dice from those wanted."""
    corners = REGULAR + network(wanted).reshape(-1, 4, 3)
    _, probabilities = dd.differentiable_rest_batch(corners)
    # A tetrahedron has at most four rests, and one that has fewer misses by all of a missing one's.
    return torch.nn.functional.pad(probabilities, (0, 4 - probabilities.shape[1])) - wanted


def main() -> None:
    """Two hundred steps of Adam, each on 128 new dice."""
    torch.manual_seed(0)
    layers = [torch.nn.Linear(4, 32), torch.nn.Tanh(), torch.nn.Linear(32, 12)]
    network = torch.nn.Sequential(*layers).double()
    optimizer = torch.optim.Adam(network.parameters(), lr=0.01)
    test = asked(1000)
    for step in range(201):
        if step % 50 == 0:
            error = misses(network, test).abs().mean().item()
            print(f"step {step:3}: mean |p - q| of 1000 other dice {error:.4f}")
        optimizer.zero_grad()
        (misses(network, asked(128)) ** 2).sum().backward()
        optimizer.step()


if __name__ == "__main__":
    main()
