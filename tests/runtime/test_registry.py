"""Extensions are found in a folder, and added from outside."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Registry

FILE = """
from dicedesign.runtime.registry import Extension
from toys import TOYS

TOYS.register(Extension(name={name!r}, line="A toy.", rank={rank}))
"""


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry[Extension]:
    """A registry whose folder holds a late "ball" and an early "kite"."""
    (tmp_path / "box").mkdir()
    (tmp_path / "box/__init__.py").touch()
    for name, rank in (("ball", 2), ("kite", 1)):
        (tmp_path / f"box/{name}.py").write_text(FILE.format(name=name, rank=rank))
    text = (
        "from dicedesign.runtime.registry import Extension, Registry\n"
        "TOYS = Registry('toy', 'box', Extension)\n"
    )
    (tmp_path / "toys.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("toys", "box", "box.ball", "box.kite"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    import toys

    found: Registry[Extension] = toys.TOYS
    return found


def test_a_file_in_the_folder_is_an_extension(toys: Registry[Extension]) -> None:
    assert toys.names == ("kite", "ball")
    assert toys["ball"].line == "A toy."
    assert "ball" in toys


def test_a_reading_that_was_broken_off_begins_again(
    toys: Registry[Extension], tmp_path: Path
) -> None:
    """As by Ctrl-C in a notebook, which goes on."""
    kite = tmp_path / "box/kite.py"
    text = kite.read_text()
    kite.write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        len(toys.names)
    kite.write_text(text + "\n# whole again")
    assert toys.names == ("kite", "ball")


def test_one_from_outside_is_like_the_others(toys: Registry[Extension]) -> None:
    top = toys.register(Extension(name="top", line="It spins.", rank=0))
    assert toys.names == ("top", "kite", "ball")
    assert toys["top"] is top
    toys.unregister("top")
    assert "top" not in toys


def test_those_of_the_folder_come_first(toys: Registry[Extension]) -> None:
    """Whoever takes one of their names is told so at once, and nothing is lost."""
    with pytest.raises(InputError, match="toy 'kite': expected a name of its own"):
        toys.register(Extension(name="kite", line="Mine."))
    assert toys.names == ("kite", "ball")
    assert toys["kite"].line == "A toy."


def test_another_kind_is_refused(toys: Registry[Extension]) -> None:
    with pytest.raises(InputError, match="toy: expected a Extension, got 'kite'"):
        toys.register("kite")  # type: ignore[arg-type]


def test_unknown_and_taken_names(toys: Registry[Extension]) -> None:
    with pytest.raises(InputError, match="toy: expected kite, ball, got 'car'; take one of them"):
        toys["car"]
    with pytest.raises(InputError, match="toy 'ball': expected a name of its own"):
        toys.register(Extension(name="ball", line="Another."))
