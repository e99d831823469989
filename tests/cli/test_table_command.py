"""`dicedesign table`: fitted tables, JSON, files, errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.finished import box_file, finished_run
from common.kernels import compiled_only
from common.processes import kill_at_write

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws import table_fit
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.tables import load_table, mixture_tables


@pytest.fixture
def throws(tmp_path: Path) -> Path:
    """Counts of a box that rests on its small sides more often than without momentum."""
    mesh = box_file(tmp_path, (1.0, 1.1, 1.25))
    probabilities = rest_poses(read_body(mesh)).probabilities
    counts = (60, 60, 24, 26, 14, 16)
    rows = [
        f"box,box.obj,{name},{count},{p}"
        for name, count, p in zip("ABCDEF", counts, probabilities, strict=True)
    ]
    path = tmp_path / "throws.csv"
    path.write_text("die,mesh,outcome,throws,geometric\n" + "\n".join(rows) + "\n")
    return path


def fit(*arguments: object) -> int:
    return main(
        ["table", "fit", "--evaluations", "32", "--drops", "10", *map(str, arguments), "--jobs=1"]
    )


@pytest.fixture
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute the posterior with fewer points."""
    for name, value in (("PILOT", (2**8, 2**2)), ("FINAL", (2**9, 2**3)), ("DRAWS", 2**8)):
        monkeypatch.setattr(table_fit, name, value)


@compiled_only
@pytest.mark.usefixtures("few_points")
def test_a_fit_predicts_other_dice(
    throws: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    facets = [("abc"[i], sign * np.eye(3)[i]) for i in range(3) for sign in (-1.0, 1.0)]
    folder = finished_run(tmp_path / "mine", "abc", [0.5, 0.25, 0.25], facets)
    box_file(folder, (20.0, 22.0, 25.0), "die_plain.stl")
    rows = throws.read_text()
    throws.write_text(rows + rows.split("\n", 1)[1].replace("box,", "twin,"))
    out = tmp_path / "mine.json"
    arguments = ("--throws", throws, "--check", "twin", "--die", folder)
    assert fit(*arguments, "--out", out, "--json") == 0
    output, notes = capsys.readouterr()
    assert notes == f"note: wrote {out}\n"
    answer = json.loads(output)
    table = load_table(str(out))
    assert table.as_dict() == answer["table"]
    assert (table.name, table.source) == ("mine", "fitted to 200 throws of box")
    assert table.restitution == answer["parameters"]["restitution"]["fitted"]
    drawn = mixture_tables(str(out))
    assert [each.restitution for each in drawn] == [
        row["restitution"] for row in answer["posterior"]
    ]
    # Of the hand that threw, the only one.
    median = answer["sessions"][0]["quantiles"][1][1] * np.sqrt(9.81 * 0.025)
    assert np.median([np.mean(each.speed) for each in drawn]) == pytest.approx(median, rel=0.5)
    assert len(drawn) == 32
    assert np.diag(answer["correlations"]) == pytest.approx(np.ones(7))
    die, twin = answer["dice"]
    assert die["outcomes"] == ["A or B", "C or D", "E or F"]
    assert (die["throws"], die["degrees"]) == ([120, 50, 30], 2)
    # A twelfth of all drops.
    assert sum(die["simulated"]) + die["unresolved"] == 27
    assert die["by_all_dice"]["p_value"] > 0.01
    assert twin["by_all_dice"] is None
    assert twin["by_other_dice"]["p_value"] > 0.01
    mine = answer["die_at_hand"]
    assert mine["target"] == [0.5, 0.25, 0.25]
    assert sum(mine["posterior_probabilities"]) == pytest.approx(1.0)
    simulated = np.array(mine["simulated"])
    variation = np.abs(simulated / simulated.sum() - mine["target"]).sum() / 2.0
    assert mine["total_variation"] == pytest.approx(variation)

    assert fit(*arguments) == 0
    text = capsys.readouterr().out
    lines = {line.split("  ")[0]: line for line in text.splitlines()[::-1]}
    for name, entry in answer["parameters"].items():
        assert float(lines[name].split()[1]) == entry["fitted"]
    assert float(lines["box"].split()[3]) == pytest.approx(die["chi_square"], abs=0.006)
    assert "not fitted" in lines["twin"]
    assert "32 sets of parameters, 10 drops of each die for each" in text
    (session,) = answer["sessions"]
    low, height, high = np.array(session["quantiles"])[:, 0]
    start = f"session box: a drop from about {height:.2g} sizes ({low:.2g} to {high:.2g}), a "
    assert start in text
    assert session["typical"][0] == pytest.approx(0.025 * height)
    assert f"total variation from the target {variation:.4f} on the fitted table" in text


@compiled_only
@pytest.mark.usefixtures("few_points")
def test_sessions_and_materials_of_a_file(
    throws: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, *rows = throws.read_text().splitlines()
    lines = [f"{first},session,material,size_mm"]
    for name, more in (("box", "1st,oak,20"), ("twin", "1st,glass,20"), ("new", "2nd,glass,")):
        lines += [f"{row.replace('box', name, 1)},{more}" for row in rows]
    throws.write_text("\n".join(lines) + "\n")
    out = tmp_path / "mine.json"
    assert fit("--throws", throws, "--out", out) == 0
    text, notes = capsys.readouterr()
    files = {name: out.with_stem(name) for name in ("mine", "mine_1st", "mine_2nd")}
    for (name, file), material in zip(files.items(), ("oak", "oak", "glass"), strict=True):
        assert f"note: wrote {file}, with the materials {material}\n" in notes
        assert load_table(str(file)).name == name
        assert len(mixture_tables(str(file))) == 32
        # Within its range.
        assert momentum_model(str(file)) is not None
    assert text.count("session 1st: a drop from") == text.count("a = 20 mm falls from") == 1
    assert text.count("session 2nd: a drop from") == text.count("a = 25 mm falls from") == 1
    lines = text.splitlines()
    oak, glass = (
        next(line.split() for line in lines if line.startswith(f"restitution of {material}"))
        for material in ("oak", "glass")
    )
    assert float(oak[3]) == load_table(str(out)).restitution
    # Standard deviation and limits of the prior.
    assert oak[-4:] == glass[-4:] == ["0.23", "0.1", "to", "0.9"]


@pytest.mark.parametrize("names", [("Evening", "evening"), ("a b", "a-b"), ("x" * 240, "y")])
def test_sessions_without_a_file_of_their_own(
    throws: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], names: tuple[str, str]
) -> None:
    first, *rows = throws.read_text().splitlines()
    lines = [f"{first},session"]
    for number, name in enumerate(names):
        lines += [f"{row.replace('box', f'box {number}', 1)},{name}" for row in rows]
    throws.write_text("\n".join(lines) + "\n")
    assert fit("--throws", throws, "--out", tmp_path / "mine.json") == 2
    assert "session: expected short names" in capsys.readouterr().err
    assert not list(tmp_path.glob("mine*"))


@compiled_only
@pytest.mark.usefixtures("few_points")
def test_counts_that_no_table_explains(throws: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Most throws on the two smallest sides."""
    throws.write_text(throws.read_text().replace(",14,", ",600,").replace(",16,", ",700,"))
    assert fit("--throws", throws) == 1
    text = capsys.readouterr().out
    assert "no table within the limits explains box (p = 0.00025), above all E or F: 1300" in text


@compiled_only
def test_a_killed_fit_resumes_with_equal_results(
    throws: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The kill comes in a later round."""
    (tmp_path / "other").mkdir()
    whole, parts = tmp_path / "mine.json", tmp_path / "other" / "mine.json"
    assert fit("--throws", throws, "--out", whole) == 0
    output = capsys.readouterr().out
    command = ["table", "fit", "--evaluations", "32", "--drops", "10", "--throws", str(throws)]
    kill_at_write([*command, "--out", str(parts), "--jobs=1"], 20)
    assert fit("--throws", throws, "--out", parts, "--seed", "1") == 2
    assert "expected a checkpoint of this seed, got one of another" in capsys.readouterr().err
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dicedesign.cli.table_fit.MODEL", "one of an earlier version")
        assert fit("--throws", throws, "--out", parts) == 2
    assert "expected a checkpoint of this model, got one of another" in capsys.readouterr().err
    throws.write_text(throws.read_text().replace(",60,", ",61,"))
    assert fit("--throws", throws, "--out", parts) == 2
    assert "expected a checkpoint of this set of throws, got" in capsys.readouterr().err
    throws.write_text(throws.read_text().replace(",61,", ",60,"))
    with monkeypatch.context() as patch:
        patch.setattr("dicedesign.cli.table_fit.CONTACT_LAW", "springs")
        assert fit("--throws", throws, "--out", parts) == 2
    assert "expected a checkpoint of this contact law, got one of an" in capsys.readouterr().err
    assert fit("--throws", throws, "--out", parts) == 0
    captured = capsys.readouterr()
    assert captured.out == output
    assert captured.err.startswith("note: resumes from ")
    assert parts.read_bytes() == whole.read_bytes()
    assert not list(tmp_path.glob("**/*.npz"))
