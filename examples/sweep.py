"""Design dice for several targets and seeds, and compare the stability of their rests.

python examples/sweep.py
"""

from __future__ import annotations

import numpy as np

import dicedesign as dd

TARGETS = {
    "2d4": {"sum_of_dice": [4, 4]},
    "three coins": {"binomial": 3},
    "rare": [0.05, 0.25, 0.3, 0.4],
}
SEEDS = range(3)


def main() -> None:
    """Print the error of each die, and the least angle at which it tips over."""
    print(f"{'target':12} {'seed':>4}  {'error':>8}  {'margin':>6}")
    for name, target in TARGETS.items():
        for seed in SEEDS:
            die = dd.design(target, seed=seed)
            margin = np.degrees(dd.rest_poses(die.vertices).margins.min())
            print(f"{name:12} {seed:4}  {die.max_abs_error:8.1e}  {margin:5.1f}°")


if __name__ == "__main__":
    main()
