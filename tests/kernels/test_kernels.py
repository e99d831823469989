"""The compiled kernels are there wherever they can be built."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dicedesign.design.energy.terms.barycenter import LARGEST_SQUARED_DISTANCE
from dicedesign.kernels import ops as kernels
from dicedesign.rest.morse import NEAR_ANTIPODE


def test_kernels_are_built_where_there_is_a_compiler(request: pytest.FixtureRequest) -> None:
    if request.config.getoption("--without-kernels"):
        assert kernels.compiled is None
    elif any(shutil.which(name) for name in ("c++", "g++", "clang++")):
        assert kernels.compiled is not None
    else:
        pytest.skip("no C++ compiler")


def test_python_and_kernels_count_the_same_interface(repository: Path) -> None:
    module = (repository / "dicedesign" / "kernels" / "module.cpp").read_text()
    (number,) = re.findall(r'attr\("INTERFACE"\) = (\d+);', module)
    assert int(number) == kernels.INTERFACE


@pytest.mark.parametrize(
    ("source", "name", "value"),
    [
        ("areas.cpp", "NEAR_ANTIPODE", NEAR_ANTIPODE),
        ("energies.cpp", "LARGEST_SQUARED_DISTANCE", LARGEST_SQUARED_DISTANCE),
    ],
)
def test_python_and_kernels_have_the_same_constants(
    repository: Path, source: str, name: str, value: float
) -> None:
    text = (repository / "dicedesign" / "kernels" / source).read_text()
    (number,) = re.findall(rf"constexpr double {name} = (\S+);", text)
    assert float(number) == value


@pytest.mark.parametrize(("change", "used"), [(0, True), (1, False), (-1, False), (None, False)])
def test_kernels_of_another_interface_are_not_used(
    repository: Path, change: int | None, used: bool
) -> None:
    """change: of the number that they tell; None where they are missing."""
    stub = "None"
    if change is not None:
        stub = f"types.SimpleNamespace(INTERFACE={kernels.INTERFACE + change})"
    code = (
        f"import sys, types; stub = sys.modules['dicedesign_kernels'] = {stub};"
        "from dicedesign import kernels;"
        f"assert kernels.compiled is ({'stub' if used else 'None'})"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=repository, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
