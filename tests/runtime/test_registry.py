"""Extensions are listed, added by scripts, and found in installed packages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Registry


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry[Extension]:
    """Registry of two toys, "kite" and "ball"."""
    (tmp_path / "toy_box.py").write_text(
        "from dicedesign.runtime.registry import Extension\n"
        "BALL = Extension(name='ball', line='A toy.')\n"
        "KITE = Extension(name='kite', line='A toy.')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "toy_box", raising=False)
    return Registry("toy", Extension, ["toy_box:KITE", "toy_box:BALL"], "dicedesign.toys")


def test_built_in_extensions_keep_the_order_of_the_list(toys: Registry[Extension]) -> None:
    assert "toy_box" not in sys.modules
    assert toys.names == ("kite", "ball")
    assert [toy.name for toy in toys] == ["kite", "ball"]
    assert toys["ball"].line == "A toy."
    assert "ball" in toys


def test_an_interrupted_import_is_retried(toys: Registry[Extension], tmp_path: Path) -> None:
    """Ctrl-C in a notebook does not end it."""
    box = tmp_path / "toy_box.py"
    text = box.read_text()
    box.write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        len(toys.names)
    box.write_text(text + "\n# whole again")
    assert toys.names == ("kite", "ball")


def test_a_registered_extension_is_like_the_others(toys: Registry[Extension]) -> None:
    top = toys.register(Extension(name="top", line="It spins."))
    assert toys.names == ("kite", "ball", "top")
    assert toys.register(top) is toys["top"]
    faster = Extension(name="top", line="It spins faster.")
    assert toys.register(faster, replace=True) is toys["top"] is faster
    toys.unregister("top")
    assert "top" not in toys


def test_unknown_and_taken_names_and_other_kinds_are_refused(toys: Registry[Extension]) -> None:
    with pytest.raises(InputError, match="toy: expected kite, ball, got 'doll'"):
        toys["doll"]
    with pytest.raises(InputError, match="toy 'kite': expected a name of its own"):
        toys.register(Extension(name="kite", line="Mine."))
    with pytest.raises(InputError, match="toy: expected a Extension, got 'kite'"):
        toys.register("kite")  # type: ignore[arg-type]
    assert toys["kite"].line == "A toy."


def test_installed_packages_add_theirs_by_an_entry_point(tmp_path: Path) -> None:
    """In its own process, as entry points are read once."""
    (tmp_path / "my_toys.py").write_text(
        "from dicedesign.runtime.registry import Extension\n"
        "TOP = Extension(name='top', line='It spins.')\n"
    )
    metadata = tmp_path / "my_toys-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-toys\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[dicedesign.toys]\ntop = my_toys:TOP\n[dicedesign.games]\nchess = my_toys:MISSING\n"
    )
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from dicedesign.errors import InputError\n"
        "from dicedesign.runtime.registry import Extension, Registry\n"
        "print(*Registry('toy', Extension, [], 'dicedesign.toys').names)\n"
        "try:\n"
        "    Registry('game', Extension, [], 'dicedesign.games').names\n"
        "except InputError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names, error = done.stdout.splitlines()
    assert names == "top"
    assert "game 'chess' of my-toys: expected the address of a Extension" in error
