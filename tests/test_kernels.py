"""The compiled kernels are there wherever they can be built."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from dicedesign import kernels


def test_kernels_are_built_where_there_is_a_compiler(request: pytest.FixtureRequest) -> None:
    if request.config.getoption("--without-kernels"):
        assert kernels.compiled is None
    elif any(shutil.which(name) for name in ("c++", "g++", "clang++")):
        assert kernels.compiled is not None


def test_python_and_kernels_count_the_same_interface(repository: Path) -> None:
    module = (repository / "dicedesign" / "kernels" / "module.cpp").read_text()
    (number,) = re.findall(r'attr\("INTERFACE"\) = (\d+);', module)
    assert int(number) == kernels.INTERFACE
