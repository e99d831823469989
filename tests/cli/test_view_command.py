"""`dicedesign view` prints its address, ends with an interrupt, and refuses unusable input."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from common.finished import box_file
from common.processes import heed_interrupts

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


def test_a_missing_extra_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert main(["view", "--port", "0"]) == 2
    assert "pip install 'dicedesign[view]'" in capsys.readouterr().err
