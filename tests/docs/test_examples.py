"""The examples run as they stand."""

from __future__ import annotations

from pathlib import Path

import pytest
from common.doc_pages import not_there_yet, run_python
from common.paths import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_it_runs(path: Path, tmp_path: Path) -> None:
    code = path.read_text(encoding="utf-8")
    if missing := not_there_yet(code):
        pytest.skip(", ".join(missing))
    assert run_python(code, tmp_path)
