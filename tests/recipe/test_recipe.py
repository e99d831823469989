"""Valid and invalid recipes, and typed targets."""

from __future__ import annotations

import itertools
import re
import signal
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from dicedesign.concave.shapes import SHAPES
from dicedesign.errors import RecipeError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.recipe.reading import (
    format_probabilities,
    parse_recipe,
    parse_target,
    read_recipe,
    recipe_text,
)
from dicedesign.recipe.recipe import Recipe
from dicedesign.recipe.target import TargetRecipe

GOOD: dict[str, Any] = {
    "name": "test",
    "target": {"sum_of_dice": [6, 6]},
    "start": {"hendecahedron": "circus"},
}


def read(tmp_path: Path, entries: dict[str, object], changes: tuple[str, ...] = ()) -> Recipe:
    path = tmp_path / "test.yaml"
    path.write_text(yaml.safe_dump(entries))
    return read_recipe(path, changes)


def test_shipped_recipes_are_read_and_written(repository: Path, tmp_path: Path) -> None:
    recipes = sorted((repository / "recipes").glob("*.yaml"))
    assert len(recipes) >= 9
    for path in recipes:
        recipe = read_recipe(path)
        assert recipe.name == path.stem
        assert read(tmp_path, recipe.as_dict()) == recipe


CONCAVE: dict[str, Any] = {
    "name": "x",
    "target": {"fair": 3},
    "start": {"shape": "duck"},
    "method": {"concave": {}},
}


def test_a_concave_die_is_plain_unless_it_is_engraved(tmp_path: Path) -> None:
    plain, marked = (read(tmp_path, {**CONCAVE, **entries}) for entries in ({}, {"engrave": True}))
    assert plain.engrave is None
    assert marked.engrave == read(tmp_path, GOOD).engrave == EngravingOptions()
    for recipe in (plain, marked):
        assert read(tmp_path, recipe.as_dict()) == recipe
    for name in SHAPES:
        assert read(tmp_path, {**CONCAVE, "start": {"shape": name}}).start.options == name


def test_paths_of_fonts_and_icons_are_relative_to_the_recipe(tmp_path: Path) -> None:
    options = {"font": "fonts/a.OTF", "icons": {6: "six.svg", 7: "/seven.svg"}}
    recipe = read(tmp_path, {**GOOD, "engrave": options}, ("engrave.icons.8=eight.svg",))
    assert recipe.engrave.font == str(tmp_path / "fonts" / "a.OTF")
    six, seven, eight = str(tmp_path / "six.svg"), "/seven.svg", str(Path.cwd() / "eight.svg")
    assert recipe.engrave.icons == {"6": six, "7": seven, "8": eight}
    assert read(tmp_path, recipe.as_dict()) == recipe
    named = read(tmp_path, {**GOOD, "engrave": {"font": "DejaVu Serif"}})
    assert named.engrave.font == "DejaVu Serif"


def test_a_mesh_path_is_relative_to_the_recipe_and_in_a_change_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "recipes"
    folder.mkdir()
    (folder / "r.yaml").write_text("name: r\ntarget: {fair: 4}\nstart: {mesh: {path: a.stl}}\n")
    monkeypatch.chdir(tmp_path)
    for changes, path in (([], folder / "a.stl"), (["start.mesh.path=b.stl"], tmp_path / "b.stl")):
        recipe = read_recipe(Path("recipes/r.yaml"), changes)
        assert recipe.start.mesh.path == str(path)
        Path("again.yaml").write_text(recipe_text(recipe))
        assert read_recipe(Path("again.yaml")) == recipe


def test_fractions_labels_and_exponents(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(
        "name: r\ntarget: {probabilities: [1/2, 1/3, 1 / 6], labels: [1, b, '03']}\n"
        "start: {prism: {sides: 3}}\nassignment: [b, 1, '03']\n"
        "method: {paper: {tolerance: 1e-5}}\ncenter_of_mass: [0, 0, 1e-2]\n"
    )
    recipe = read_recipe(path, ["method.paper.sobolev=null", "size_mm=25"])
    target = recipe.target.target()
    assert target.labels == ("1", "b", "03")
    assert target.probabilities.tolist() == pytest.approx([1 / 2, 1 / 3, 1 / 6], abs=1e-16)
    assert recipe.face_of_direction() == [1, 0, 2]
    assert recipe.method.paper.tolerance == 1e-5
    assert recipe.center_of_mass == (0.0, 0.0, 0.01)
    assert recipe.size_mm == 25.0


BAD_CONCAVE = [
    ("start: {shape: dog}", "start.shape.*'dragon'.*'dog'"),
    ("start: {search: {}}", "start: "),
    ("method: exact", "start.shape.*method: .concave"),
    ("center_of_mass: [0, 0, 1]", "center_of_mass: "),
    ("min_inradius_mm: 1", "min_inradius_mm: "),
    ("method: {concave: {fil: 1}}", "concave.fil: .*'fill'"),
    ("attempts: 3", "attempts: .*method.concave.attempts"),
]

BAD = [
    ("nmae: x", "nmae: .*'name'"),
    ("method: {paper: {weights: {coplaner: 1}}}", "weights.coplaner: .*coplanar"),
    ("labels: [a, b]", "labels: .*target.labels"),
    ("evaluatons: {}", "evaluatons: .*method.exact.evaluations"),
    ("target: {fair: 2, labels: [yes, no]}", "target.labels.0: .*True"),
    (f"target: {{fair: 2, labels: [{25 * 'x'}, y]}}", "labels.*24"),
    ("method: {exact: {probabilities: thrown, hand: foot}}", "hand: .*cup.*'foot'"),
    ("method: {exact: {hand: cup}}", "hand: .*thrown"),
    ("method: {exact: {refine: {}}}", "refine: .*thrown"),
    ("start: {prism: {height: .inf}}", "start.prism.height: .*inf"),
    ("target: {fair: 4}", "start.hendecahedron: .*11.*got 4"),
    ("target: {fair: 3}\nstart: {repulsion: {}}", "start.repulsion: .*got 3"),
    ("target: {fair: 2}\nstart: {prism: {}}", "start: .*search"),
    ("name: ../x", "name: "),
    ("target: {fair: 3, binomial: 2}", "binomial and fair"),
    ("target: {binomial: 0}", "target: binomial: .*got 0"),
    ("assignment: [2, 3]", "assignment: .*got 2, 3"),
    ("method: {paper: {tolerance: 2}}", "tolerance: "),
    ("method: {exact: {sobolev: {}}}", "sobolev: .*vertices"),
    ("size_mm: 1000.1", "size_mm"),
    ("size_mm: 30.0\nmin_inradius_mm: 15.0", "min_inradius_mm"),
    ("symmetry: C5v", "symmetry: .*orbits"),
    ("symmetry: Cs\nmethod: {exact: {coordinates: vertices}}", "symmetry: .*facets"),
    ("symmetry: Cs\ncenter_of_mass: [0, 0, 0]", "center_of_mass: "),
    ("target: {sum_of_dice: [6, 6], faces: 30}", "faces: .*36"),
    ("target: {sum_of_dice: [6, 6], faces: 10}", "faces: .*got 10"),
    ("target: {probabilities: [0.0123, 0.9877], faces: 12}", "target: faces: "),
    ("target: {probabilities: [0.2, 0.3, 0.5], labels: [a, b, a], faces: 100}", "target: faces: "),
    ("prior: vmf:0,0,0:1", "prior: "),
    ("prior: half:0,0,1\nmethod: paper", "paper"),
    ("prior: half:0,0,1\nsymmetry: C2", "symmetry"),
    ("prior: half:0,0,1\nmethod: {exact: {probabilities: thrown}}", "thrown"),
    ("prior: samples:samples.csv", "prior: "),
    ("inside: cavity", "inside: .*center_of_mass"),
    ("center_of_mass: [0.1, 0, 0]\ninside: {wall_mm: -1}", "inside.*wall_mm"),
]


@pytest.mark.parametrize(
    ("good", "entries", "message"),
    [*((GOOD, *bad) for bad in BAD), *((CONCAVE, *bad) for bad in BAD_CONCAVE)],
)
def test_bad_recipes_are_explained(good: dict[str, Any], entries: str, message: str) -> None:
    """By the key, and by what is close to it."""
    with pytest.raises(RecipeError, match=message) as caught:
        parse_recipe({**good, **yaml.safe_load(entries)})
    assert "\n" not in str(caught.value)


BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 60))
"""Small text of very many entries."""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name: x\nstart: {prism: {}}\n", "target: "),
        ("", "keys"),
        ("name: [", "closing bracket"),
        ("name: a\nlabels: [a,\n  b\nseed: 4\n", "line 2: .*closing bracket"),
        ("name: a\ntarget: {fair: 3}}\n", "line 2: .*bracket"),
        ("name: 'a\ntarget: d6\n", "line 1: .*closing quote"),
        ("name: a\ntarget d6\nseed: 3\n", "line 2: .*colon.*'target d6'"),
        ("name: a\ntarget:d6\nseed: 3\n", "line 2: .*colon.*'target:d6'"),
        ("name: a: b\nseed: 3\n", "line 1: .*colon"),
        ("target:\n\tfair: 3\n", "line 2: .*tab"),
        ("name: a\n  target: d6\n", "line 2: .*spaces"),
        ("target:\n  fair: 3\n labels: [a]\n", "line 3: .*spaces"),
        ("name: a\n- b\n", "line 2: .*spaces"),
        ("name: %a\n", "quotes"),
        ("name: a\nseed: *x\n", "line 2, column 7"),
        ("name: a\nname: b\n", "line 2: .*once"),
        ("2024-01-01: 3\n", "keys"),
        ("x: !!int x\n", "YAML"),
        (BOMB, "10000 entries"),
        ("target: &a [*a]\n", "30"),
        ("target: " + 100_000 * "[", "30 within"),
        ("name: [" + 100_000 * "1," + "1]", "10000 entries"),
        ("name: 1" + 100_000 * ":1", "10000 characters"),
        ("name: 1" + 4000 * ":1" + ".5", "YAML"),
        ("name: a\ntarget: {fair: 3}\nsize_mm: " + 9999 * "1" + "!", "size_mm: "),
        ("name: '" + (1 << 20) * "x" + "'", "1048576 characters"),
        ("name: a\ntarget: " + 99 * "999d1-" + "d1", "1000 dice"),
        ("name: a\ntarget: {fair: 3}\nseed: 1" + 5000 * "0", "YAML"),
        ("name: a\ntarget: {fair: 3}\nseed: 18446744073709551616", "seed: "),
    ],
)
def test_invalid_files_are_explained_at_once(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(content)
    signal.alarm(30)
    try:
        with pytest.raises(RecipeError, match=message) as caught:
            read_recipe(path)
    finally:
        signal.alarm(0)
    assert str(caught.value).startswith(str(path))
    assert not re.search("scann|token|mapping values|find expected|<block", str(caught.value))
    assert len(str(caught.value)) < 1000


def test_yaml_runs_no_code(tmp_path: Path) -> None:
    path, touched = tmp_path / "code.yaml", tmp_path / "touched"
    for tag in ("apply:pathlib.Path.touch", "new:os.system", "name:os.system", "module:os"):
        for prefix in ("object/", ""):
            path.write_text(f"target: !!python/{prefix}{tag} ['{touched}']\n")
            with pytest.raises(RecipeError):
                read_recipe(path)
    assert not touched.exists()


@pytest.mark.parametrize("change", ["size_mm", "size_mm=["])
def test_bad_changes(tmp_path: Path, change: str) -> None:
    with pytest.raises(RecipeError, match="--set size_mm: "):
        read(tmp_path, GOOD, (change,))


@pytest.mark.parametrize(
    ("text", "size_mm"),
    [("3cm", 30.0), (" 25 mm", 25.0), ("1.1in", 27.94), (".03 m", 30.0), ("40", 40.0)],
)
def test_lengths_with_units(text: str, size_mm: float) -> None:
    recipe = parse_recipe({**GOOD, "size_mm": text, "engrave": {"margin_mm": text}})
    assert recipe.size_mm == recipe.engrave.margin_mm == size_mm


@pytest.mark.parametrize("entries", ["size_mm: 1000.0", "size_mm: 30.0\nmin_inradius_mm: 14.999"])
def test_limits_are_valid(entries: str) -> None:
    parse_recipe({**GOOD, **yaml.safe_load(entries)})


@pytest.mark.parametrize("given", [{}, {"method": "exact"}])
def test_a_change_adds_missing_parts(tmp_path: Path, given: dict[str, object]) -> None:
    entries = {"name": "die", "target": {"fair": 4}, **given}
    recipe = read(tmp_path, entries, ("method.exact.starts=7",))
    assert recipe.method.options.starts == 7


@pytest.mark.parametrize(
    ("text", "entries"),
    [
        ("fair: 7", {"fair": 7}),
        (" fair:7", {"fair": 7}),
        ("{binomial: 4}", {"binomial": 4}),
        ("probabilities: [1/2, 0.5]", {"probabilities": ["1/2", 0.5]}),
        ("1/2,1/3, 1/6", {"probabilities": ["1/2", "1/3", "1/6"]}),
    ],
)
def test_typed_targets(text: str, entries: dict[str, object]) -> None:
    assert parse_target(text) == entries
    assert parse_target(text, "a, b") == {**entries, "labels": ["a", "b"]}


def of_sum(*ways: int) -> list[float]:
    """Probabilities of totals that come about in numbers of ways."""
    return [way / sum(ways) for way in ways]


@pytest.mark.parametrize(
    ("text", "labels", "probabilities"),
    [
        ("d7", "1 2 3 4 5 6 7", [1 / 7] * 7),
        ("2d6", "2 3 4 5 6 7 8 9 10 11 12", of_sum(1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1)),
        ("2dF", "-2 -1 0 +1 +2", of_sum(1, 2, 3, 2, 1)),
        ("dF", "+ 0 -", [1 / 3] * 3),
        ("d4 + d6", "2 3 4 5 6 7 8 9 10", of_sum(1, 2, 3, 4, 4, 4, 3, 2, 1)),
        ("1:2:3", "1 2 3", of_sum(1, 2, 3)),
        ("50%, 30 %,20%", "1 2 3", [0.5, 0.3, 0.2]),
        ("d6+2", "3 4 5 6 7 8", [1 / 6] * 6),
        ("2d3 - 1", "1 2 3 4 5", of_sum(1, 2, 3, 2, 1)),
        ("d%", "00 10 20 30 40 50 60 70 80 90", [1 / 10] * 10),
        ("D00", "00 10 20 30 40 50 60 70 80 90", [1 / 10] * 10),
        ("d% + d10", " ".join(map(str, range(1, 101))), [1 / 100] * 100),
        ("d100", " ".join(map(str, range(1, 101))), [1 / 100] * 100),
    ],
)
def test_targets_as_people_type_them(text: str, labels: str, probabilities: list[float]) -> None:
    target = TargetRecipe.model_validate(parse_target(text)).target()
    assert list(target.labels) == labels.split()
    np.testing.assert_allclose(target.probabilities, probabilities, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "sides", "value"),
    [
        ("2d6kh1", [6, 6], max),
        ("2d20kl", [20, 20], min),
        ("4d6kh3", [6] * 4, lambda dice: sum(dice) - min(dice)),
        ("3d4kl2 + d6 - 1", [4, 4, 4, 6], lambda dice: sum(dice) - max(dice[:3]) - 1),
        ("d4-d6", [4, 6], lambda dice: dice[0] - dice[1]),
    ],
)
def test_dice_of_which_some_are_kept(
    text: str, sides: list[int], value: Callable[[Sequence[int]], int]
) -> None:
    """All throws, one by one."""
    count = Counter(map(value, itertools.product(*(range(1, each + 1) for each in sides))))
    target = TargetRecipe.model_validate(parse_target(text)).target()
    assert target.labels == tuple(map(str, sorted(count)))
    probabilities = [count[each] / count.total() for each in sorted(count)]
    np.testing.assert_allclose(target.probabilities, probabilities, rtol=1e-14)


@pytest.mark.parametrize(
    ("dice", "beyond", "outcomes"),
    [
        ("d100 - d101", "d101 - d101", 200),
        ("2d200kh1", "2d201kh1", 200),
        ("20d2kh1", "21d2kh1", 2),
        ("d200 + 1", "d201 + 1", 200),
    ],
)
def test_the_most_dice_and_outcomes(dice: str, beyond: str, outcomes: int) -> None:
    assert len(TargetRecipe.model_validate(parse_target(dice)).target().labels) == outcomes
    with pytest.raises((RecipeError, ValueError)):
        TargetRecipe.model_validate(parse_target(beyond))


@pytest.mark.parametrize("text", ["a:", ": :", "[a: 1]", "fair: [", "!!python/x: y", "- a: 1"])
def test_invalid_typed_targets(text: str) -> None:
    with pytest.raises((RecipeError, ValueError)):
        TargetRecipe.model_validate(parse_target(text))


def test_probabilities_are_written_to_the_last_bit() -> None:
    drawn = np.random.default_rng(0).dirichlet(np.ones(5)).tolist()
    for probabilities in ([k / 21.0 for k in range(1, 7)], drawn, [1e-9, 1.0 - 1e-9]):
        text = format_probabilities(probabilities)
        assert TargetRecipe.model_validate(parse_target(text)).probabilities == probabilities
    assert format_probabilities([1 / 2, 1 / 3, 0.13888888888888887]) == "1/2, 1/3, 5/36"
