"""Valid and invalid recipes, and typed targets."""

from __future__ import annotations

import signal
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


@pytest.mark.parametrize("method", ["concave", {"concave": {}}, {"concave": {"points": 500}}])
def test_a_concave_die_is_plain_by_default(method: object, tmp_path: Path) -> None:
    plain = read(tmp_path, {**CONCAVE, "method": method})
    assert plain.engrave is None
    assert plain.as_dict()["engrave"] is False
    marked = read(tmp_path, {**CONCAVE, "method": method, "engrave": True})
    assert marked.engrave == EngravingOptions()
    assert read(tmp_path, {**CONCAVE, "method": method, "engrave": {"margin_mm": 0.2}}).engrave
    for recipe in (plain, marked):
        assert read(tmp_path, recipe.as_dict()) == recipe
    assert read(tmp_path, GOOD).engrave == EngravingOptions()


def test_every_built_in_shape_is_a_start(tmp_path: Path) -> None:
    for name in SHAPES:
        assert read(tmp_path, {**CONCAVE, "start": {"shape": name}}).start.options == name
    listed = Recipe.model_json_schema()["properties"]["start"]["properties"]["shape"]
    assert listed["anyOf"][0]["enum"] == list(SHAPES)


def test_paths_of_fonts_and_icons_are_relative_to_the_recipe(tmp_path: Path) -> None:
    options = {"font": "fonts/a.OTF", "icons": {6: "six.svg", 7: "/seven.svg"}}
    recipe = read(tmp_path, {**GOOD, "engrave": options}, ("engrave.icons.8=eight.svg",))
    assert recipe.engrave.font == str(tmp_path / "fonts" / "a.OTF")
    six, seven, eight = str(tmp_path / "six.svg"), "/seven.svg", str(Path.cwd() / "eight.svg")
    assert recipe.engrave.icons == {"6": six, "7": seven, "8": eight}
    assert read(tmp_path, recipe.as_dict()) == recipe
    named = read(tmp_path, {**GOOD, "engrave": {"font": "DejaVu Serif", "upright": [0, 0, 1]}})
    assert (named.engrave.font, named.engrave.upright) == ("DejaVu Serif", (0.0, 0.0, 1.0))
    assert read(tmp_path, named.as_dict()) == named


def test_a_mesh_path_is_relative_to_the_recipe_and_in_a_change_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, elsewhere = tmp_path / "recipes", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (folder / "r.yaml").write_text("name: r\ntarget: {fair: 4}\nstart: {mesh: {path: a.stl}}\n")
    monkeypatch.chdir(tmp_path)
    recipe = read_recipe(Path("recipes/r.yaml"))
    changed = read_recipe(Path("recipes/r.yaml"), ["start.mesh.path=b.stl"])
    monkeypatch.chdir(elsewhere)
    for given, path in ((recipe, folder / "a.stl"), (changed, tmp_path / "b.stl")):
        assert given.start.mesh.path == str(path)
        (elsewhere / "again.yaml").write_text(recipe_text(given))
        assert read_recipe(Path("again.yaml")) == given


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


BAD_CONCAVE: list[tuple[dict[str, Any], str]] = [
    ({"start": {"shape": "dog"}}, "start.shape: expected 'dragon', .*got 'dog'"),
    ({"start": {"search": {}}}, "start: expected a surface to keep .*; write start: "),
    ({"method": "exact"}, r"start.shape: expected method: \{concave: \{\}\} with it, got exact"),
    ({"center_of_mass": [0, 0, 1]}, "center_of_mass: expected uniform .*; leave it out"),
    ({"min_inradius_mm": 1}, "min_inradius_mm: expected the exact method, .*, got concave"),
    ({"method": {"concave": {"fil": 1}}}, r"concave.fil: unknown key; did you mean 'fill'\?"),
    ({"attempts": 3}, "attempts: unknown key; it belongs at method.concave.attempts"),
]

BAD: list[tuple[dict[str, Any], str]] = [
    ({"nmae": "x"}, r"nmae: unknown key; did you mean 'name'\?"),
    (
        {"method": {"paper": {"weights": {"coplaner": 1}}}},
        "weights.coplaner: unknown key.*coplanar",
    ),
    ({"labels": ["a", "b"]}, "labels: unknown key; it belongs at target.labels"),
    ({"evaluatons": {}}, r"evaluatons: unknown key; did you mean method.exact.evaluations\?"),
    (
        {"target": {"fair": 2, "labels": [True, "no"]}},
        "target.labels.0: expected a text, got True, .*; put it in quotes",
    ),
    ({"target": {"fair": 2, "labels": ["x" * 25, "y"]}}, "labels.*: expected 1 to 24 characters"),
    ({"target": {"fair": 2, "labels": ["a", "\ud800"]}}, "labels"),
    (
        {"method": {"exact": {"probabilities": "thrown", "hand": "foot"}}},
        "method.exact: hand: expected cup, hand, tower, got 'foot'; take one of them",
    ),
    ({"method": {"exact": {"hand": "cup"}}}, "hand: expected probabilities .thrown. with it"),
    ({"method": {"exact": {"refine": {}}}}, "refine: expected probabilities .thrown. with it"),
    ({"start": {"prism": {"height": float("inf")}}}, "start.prism.height: .*finite.*got inf"),
    (
        {"target": {"fair": 4}},
        "start.hendecahedron: expected a target of 11 outcomes, one for each facet, got 4",
    ),
    (
        {"target": {"fair": 3}, "start": {"repulsion": {}}},
        "start.repulsion: expected a target of at least 4 outcomes, got 3; take a prism",
    ),
    (
        {"target": {"fair": 2}, "start": {"prism": {}}},
        r"start: expected a mesh or a search for 2 .*write start: \{search: \{\}\}, or start: ",
    ),
    ({"name": "../x"}, "name: "),
    ({"target": {"fair": 3, "binomial": 2}}, "exactly one of.*got binomial and fair"),
    ({"target": {"binomial": 0}}, "target: binomial: expected a whole number of at least 1, got 0"),
    ({"assignment": [2, 3]}, "assignment: expected each of the labels 2, 3, .* once, got 2, 3"),
    ({"method": {"paper": {"tolerance": 2}}}, "tolerance: expected a number from 1e-15 on and"),
    ({"method": {"exact": {"sobolev": {}}}}, 'sobolev: expected coordinates "vertices"'),
    ({"size_mm": 1000.1}, "size_mm"),
    ({"size_mm": 30.0, "min_inradius_mm": 15.0}, "min_inradius_mm"),
]


@pytest.mark.parametrize(
    ("good", "entries", "message"),
    [*((GOOD, *bad) for bad in BAD), *((CONCAVE, *bad) for bad in BAD_CONCAVE)],
)
def test_bad_recipes_are_explained(
    good: dict[str, Any], entries: dict[str, Any], message: str
) -> None:
    with pytest.raises(RecipeError, match=message) as caught:
        parse_recipe({**good, **entries})
    assert "\n" not in str(caught.value)


BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 60))
"""Small text of very many entries."""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name: x\nstart: {prism: {}}\n", "target: expected this key, but it is missing"),
        ("", "expected keys and values"),
        ("name: [", "expected YAML, but"),
        ("name: a\nname: b\n", "'name' appears twice, the second time in line 2"),
        ("2024-01-01: 3\n", "expected texts as keys.*but keys must be str"),
        ("x: !!int x\n", "expected YAML, but"),
        (BOMB, "expected at most 10000 entries"),
        ("target: &a [*a]\n", "expected entries at most 30 within each other"),
        ("target: " + 100_000 * "[", "expected YAML, but"),
        ("name: a\ntarget: {fair: 3}\nseed: 1" + 5000 * "0", "expected YAML, but .*digits"),
        ("name: a\ntarget: {fair: 3}\nseed: 18446744073709551616", "seed: expected a number below"),
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
    assert len(str(caught.value)) < 1000


def test_yaml_runs_no_code(tmp_path: Path) -> None:
    path = tmp_path / "code.yaml"
    touched = tmp_path / "touched"
    for tag in ("apply:pathlib.Path.touch", "new:os.system", "name:os.system", "module:os"):
        path.write_text(f"target: !!python/object/{tag} ['{touched}']\n")
        with pytest.raises(RecipeError, match="could not determine a constructor for the tag"):
            read_recipe(path)
        path.write_text(f"target: !!python/{tag} ['{touched}']\n")
        with pytest.raises(RecipeError, match="could not determine a constructor for the tag"):
            read_recipe(path)
    assert not touched.exists()


def test_bad_changes(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match="--set size_mm: expected key=value"):
        read(tmp_path, GOOD, ("size_mm",))
    with pytest.raises(RecipeError, match="--set size_mm: expected YAML"):
        read(tmp_path, GOOD, ("size_mm=[",))


@pytest.mark.parametrize(
    "entries",
    [
        {"size_mm": 1000.0},
        {"size_mm": 30.0, "min_inradius_mm": 14.999},
        {"target": {"fair": 11, "labels": list("abcdefghijä")}},
    ],
)
def test_limits_are_valid(entries: dict[str, Any]) -> None:
    assert isinstance(parse_recipe({**GOOD, **entries}), Recipe)


@pytest.mark.parametrize("method", ["", "method: exact\n"])
def test_a_change_adds_missing_parts(tmp_path: Path, method: str) -> None:
    path = tmp_path / "die.yaml"
    path.write_text("name: die\ntarget: {fair: 4}\n" + method)
    assert read_recipe(path, ["method.exact.starts=7"]).method.options.starts == 7


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


@pytest.mark.parametrize(
    ("text", "labels", "probabilities"),
    [
        ("d7", list("1234567"), [1 / 7] * 7),
        (
            "2d6",
            [str(k) for k in range(2, 13)],
            [k / 36 for k in (1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1)],
        ),
        ("2dF", ["-2", "-1", "0", "+1", "+2"], [k / 9 for k in (1, 2, 3, 2, 1)]),
        ("dF", ["+", "0", "-"], [1 / 3] * 3),
        ("d4 + d6", [str(k) for k in range(2, 11)], [k / 24 for k in (1, 2, 3, 4, 4, 4, 3, 2, 1)]),
        ("1:2:3", list("123"), [1 / 6, 1 / 3, 1 / 2]),
        ("50%, 30 %,20%", list("123"), [0.5, 0.3, 0.2]),
    ],
)
def test_targets_as_people_type_them(
    text: str, labels: list[str], probabilities: list[float]
) -> None:
    target = TargetRecipe.model_validate(parse_target(text)).target()
    assert list(target.labels) == labels
    np.testing.assert_allclose(target.probabilities, probabilities, rtol=1e-14)


@pytest.mark.parametrize("text", ["a:", ": :", "[a: 1]", "fair: [", "!!python/x: y", "- a: 1"])
def test_invalid_typed_targets(text: str) -> None:
    with pytest.raises((RecipeError, ValueError)):
        TargetRecipe.model_validate(parse_target(text))


def test_probabilities_are_written_to_the_last_bit() -> None:
    random = np.random.default_rng(0)
    for probabilities in (
        np.arange(1, 7) / 21.0,
        random.dirichlet(np.ones(5)),
        np.array([1e-9, 1.0 - 1e-9]),
    ):
        text = format_probabilities(probabilities.tolist())
        read = TargetRecipe.model_validate(parse_target(text))
        assert read.probabilities == probabilities.tolist()
    assert format_probabilities([1 / 2, 1 / 3, 1 / 6]) == "1/2, 1/3, 1/6"
