"""Print requirements of pyproject.toml without torch, one a line.

Usage: python .ci/requirements.py [--lowest] [EXTRA ...]

--lowest: the lowest version that each allows, and no other.
"""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
lowest = "--lowest" in sys.argv
lines = list(project["dependencies"])
for extra in sys.argv[1:]:
    if extra != "--lowest":
        lines += project["optional-dependencies"][extra]
for line in lines:
    if not re.match(r"(torch|dicedesign)\b", line):
        print(re.sub(r">=([\w.]+).*", r"==\1", line) if lowest else line)
