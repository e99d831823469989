"""`dicedesign view` prints its address, ends with an interrupt, and refuses unusable input."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from common.finished_run import box_file
from common.signals import heed_interrupts

from dicedesign.cli.main import main


def test_the_page_is_served_until_an_interrupt(tmp_path: Path) -> None:
    box_file(tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-m", "dicedesign", "view", "box.obj", "--port", "0", "--no-browser"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    with process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)
        with urllib.request.urlopen(address, timeout=60) as answer:
            assert b"<title>dicedesign</title>" in answer.read()
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert error == "dicedesign: interrupted; the page is closed\n"


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["view", "--no-browser", *arguments]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("dicedesign: ")
    assert error.count("\n") == 1
    return error


def test_unusable_paths_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\n")
    (tmp_path / "nan.xyz").write_text("0 0 0\n1 0 0\n0 1 nan\n0 0 1\n")
    (tmp_path / "bad.yaml").write_text("name: d4\ntarget: {fare: 4}\n")
    (tmp_path / "empty").mkdir()
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "result.json").write_text("{")
    (tmp_path / "open.yaml").write_text(
        "name: d4\ntarget: {fair: 4}\nstart: {mesh: {path: flat.obj}}\nmethod: {concave: {}}\n"
    )
    port = ("--port", "0")
    assert "no such file" in refusal(capsys, str(tmp_path / "none.stl"), *port)
    assert "flat.obj: expected" in refusal(capsys, str(tmp_path / "flat.obj"), *port)
    assert "finite" in refusal(capsys, str(tmp_path / "nan.xyz"), *port)
    assert "bad.yaml: target" in refusal(capsys, str(tmp_path / "bad.yaml"), *port)
    assert "flat.obj" in refusal(capsys, str(tmp_path / "open.yaml"), *port)
    assert "expected a folder with meshes" in refusal(capsys, str(tmp_path / "empty"), *port)
    assert "result.json: expected the result" in refusal(capsys, str(tmp_path / "half"), *port)


def test_a_missing_extra_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "pip install 'dicedesign[view]'" in refusal(capsys, "--port", "0")
