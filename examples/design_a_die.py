"""Design a die that comes up like the total of two four-sided dice, and save it with and without
its labels.

    python examples/design_a_die.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import dicedesign as dd


def main() -> None:
    """Design, tell, engrave, save."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/examples")
    folder.mkdir(parents=True, exist_ok=True)
    die = dd.design({"sum_of_dice": [4, 4]}, size_mm=32.0)
    print(die.message)
    for label, wanted, reached in zip(die.labels, die.target, die.probabilities, strict=True):
        print(f"{label:>3}  wanted {wanted:.6f}  reached {reached:.6f}")
    die.save(folder / "total_of_2d4_plain.stl")
    die.engrave()
    die.save(folder / "total_of_2d4.stl")
    print("saved in", folder)


if __name__ == "__main__":
    main()
