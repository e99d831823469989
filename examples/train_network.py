"""Train a small network that maps probabilities to the corners of a tetrahedron with them.

python examples/train_network.py
"""

from __future__ import annotations

import torch

import dicedesign as dd

REGULAR = torch.tensor([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=torch.float64)


def random_targets(count: int) -> torch.Tensor:
    """(count, 4) random probabilities in descending order."""
    uneven = torch.softmax(0.35 * torch.randn(count, 4, dtype=torch.float64), dim=1)
    return uneven.sort(dim=1, descending=True).values


def errors(network: torch.nn.Module, targets: torch.Tensor) -> torch.Tensor:
    """(count, 4) differences between the probabilities of the network's dice and the targets."""
    corners = REGULAR + network(targets).reshape(-1, 4, 3)
    _, probabilities = dd.differentiable_rest_batch(corners)
    # A tetrahedron has at most four rests; a missing rest has probability 0.
    return torch.nn.functional.pad(probabilities, (0, 4 - probabilities.shape[1])) - targets


def main() -> None:
    """Run two hundred steps of Adam, each on 128 new targets."""
    torch.manual_seed(0)
    layers = [torch.nn.Linear(4, 32), torch.nn.Tanh(), torch.nn.Linear(32, 12)]
    network = torch.nn.Sequential(*layers).double()
    optimizer = torch.optim.Adam(network.parameters(), lr=0.01)
    test = random_targets(1000)
    for step in range(201):
        if step % 50 == 0:
            error = errors(network, test).abs().mean().item()
            print(f"step {step:3}: mean |p - q| of 1000 other dice {error:.4f}")
        optimizer.zero_grad()
        (errors(network, random_targets(128)) ** 2).sum().backward()
        optimizer.step()


if __name__ == "__main__":
    main()
