"""A search on a Dask cluster: a scheduler and two workers as processes of this machine."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any
from unittest.mock import MagicMock

import dask
import pytest
from common.inline_executor import Inline
from distributed import Client

from dicedesign import __version__
from dicedesign.cli.main import main
from dicedesign.errors import DiceError, InputError
from dicedesign.recipe.recipe import Recipe
from dicedesign.runtime import workers
from dicedesign.runtime.workers import cluster_workers
from dicedesign.search.study import open_study
from dicedesign.search.trials import run_search

PATIENCE = 60.0

TLS = "distributed.comm.tls"
"""Key of the certificates in Dask's configuration."""


def start_process(
    stack: ExitStack, folder: Path, environment: Mapping[str, str], *arguments: str
) -> subprocess.Popen[bytes]:
    """Start a process of Dask that ends with the stack."""
    log = stack.enter_context((folder / f"{arguments[0]}.log").open("ab"))
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        cwd=folder,
        stdout=log,
        stderr=log,
        # A task fails with its worker; the search retries it.
        env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0", **environment},
    )
    stack.callback(process.wait, PATIENCE)
    stack.callback(process.kill)
    return process


def start_cluster(
    stack: ExitStack,
    folder: Path,
    count: int,
    environment: Mapping[str, str] = MappingProxyType({}),
    protocol: str = "tcp",
) -> tuple[str, list[subprocess.Popen[bytes]]]:
    """Start a scheduler and `count` workers of one thread; returns address and processes."""
    local = ("--protocol", protocol, "--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
    place = folder / "scheduler.json"
    file = ("--scheduler-file", str(place))
    scheduler = start_process(stack, folder, environment, "scheduler", *local, "--port", "0", *file)
    options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
    workers = [
        start_process(stack, folder, environment, "worker", *local, *file, *options)
        for _ in range(count)
    ]
    deadline, address = time.monotonic() + PATIENCE, None
    while address is None:
        assert time.monotonic() < deadline, (folder / "scheduler.log").read_text()
        time.sleep(0.05)
        # The file may be missing or incomplete.
        with suppress(FileNotFoundError, json.JSONDecodeError):
            address = json.loads(place.read_text())["address"]
    return address, [*workers, scheduler]


@pytest.fixture(scope="module")
def cluster(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Cluster of two workers. The first test kills one of them, the second everything."""
    with ExitStack() as stack:
        address, processes = start_cluster(stack, tmp_path_factory.mktemp("cluster"), 2)
        with Client(address, timeout=PATIENCE, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        yield address, processes


def test_trials_of_a_lost_worker_are_retried(
    tmp_path: Path, recipe_path: Path, recipe: Recipe, cluster: Any
) -> None:
    """A worker is stopped during a trial, and killed after other trials."""
    address, processes = cluster
    stored: list[dict[str, Any]] = []
    on_dead_worker: list[str] = []

    with (
        Client(address, timeout=PATIENCE, set_as_default=False) as client,
        open_study(tmp_path / "out", recipe) as study,
        cluster_workers(address) as (executor, threads),
    ):
        pids = client.run(os.getpid)
        (dying,) = (where for where, pid in pids.items() if pid == processes[0].pid)

        def on_trial(_: dict[str, Any]) -> None:
            finished = len(study.finished())
            if finished == 2:
                processes[0].send_signal(signal.SIGSTOP)
            if finished == 4:
                stored.extend(study.finished())
                on_dead_worker.extend(client.processing()[dying])
                processes[0].kill()

        assert threads == 2
        run_search(study, 7, executor, 3, on_trial=on_trial)
        finished_trials = study.finished()
        states = [trial.state.name for trial in study._study.get_trials()]
    assert on_dead_worker
    assert processes[0].wait(PATIENCE) == -signal.SIGKILL
    assert states == ["COMPLETE"] * 7
    assert sorted(trial["number"] for trial in finished_trials) == list(range(7))
    assert all(trial in finished_trials for trial in stored)
    assert all(trial["status"] == "converged" for trial in finished_trials)

    # The command continues with the other worker.
    search = ["search", str(recipe_path), "--scheduler", address, "--out", str(tmp_path / "out")]
    assert main([*search, "--trials", "8"]) == 0
    with open_study(tmp_path / "out", recipe) as study:
        again = study.finished()
    assert len(again) == 8
    assert again[:7] == finished_trials


def test_finished_trials_survive_the_scheduler(
    tmp_path: Path, recipe: Recipe, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The workers are killed, and then the scheduler."""
    address, processes = cluster
    monkeypatch.setattr(workers, "PATIENCE", 2.0)

    def on_trial(_: dict[str, Any]) -> None:
        for process in processes:
            process.kill()

    with open_study(tmp_path / "out", recipe) as study:
        with (
            cluster_workers(address) as (executor, _),
            pytest.raises(DiceError, match="expected a Dask scheduler until the end"),
        ):
            run_search(study, 1000, executor, 2, on_trial=on_trial)
        stored = study.finished()
        assert stored
        run_search(study, len(stored) + 1, Inline(), 1)
        assert study.finished()[: len(stored)] == stored


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make certificates with")
def test_an_encrypted_cluster(
    tmp_path: Path, recipe_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A self-signed certificate is required to connect."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=cluster"]
    files = ["-keyout", str(key), "-out", str(certificate)]
    subprocess.run([*command, *files], check=True, capture_output=True)
    configured = {f"{TLS}.ca-file": str(certificate)}
    for role in ("scheduler", "worker", "client"):
        configured |= {f"{TLS}.{role}.cert": str(certificate), f"{TLS}.{role}.key": str(key)}
    environment = {
        f"DASK_{name.upper().replace('.', '__').replace('-', '_')}": value
        for name, value in configured.items()
    }
    search = ["search", str(recipe_path), "--trials", "1", "--out", str(tmp_path / "out")]
    with ExitStack() as stack:
        address, _ = start_cluster(stack, tmp_path, 1, environment, "tls")
        assert address.startswith("tls://")
        with dask.config.set(configured):
            assert main([*search, "--scheduler", address]) == 0
        assert (tmp_path / "out" / "best.yaml").exists()
        monkeypatch.setattr(workers, "PATIENCE", 0.5)
        with (
            pytest.raises(InputError, match="expected a Dask scheduler that answers"),
            cluster_workers(address.replace("tls:", "tcp:")),
        ):
            pass


def test_missing_certificates_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], recipe_path: Path
) -> None:
    search = ["search", str(recipe_path), "--trials", "1", "--out", str(tmp_path / "out")]
    missing = {f"{TLS}.ca-file": "missing.pem", f"{TLS}.client.cert": "missing.pem"}
    with dask.config.set(missing):
        assert main([*search, "--scheduler", "tls://127.0.0.1:1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "certificates of tls://" in line


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"a": __version__, "b": "0.0.1"}, f"got 0.0.1, {__version__}; install the same"),
        (Exception("No module named 'dicedesign'"), "but No module named 'dicedesign'; install it"),
    ],
)
def test_workers_need_this_version(
    monkeypatch: pytest.MonkeyPatch, answer: Any, message: str
) -> None:
    """Dask raises a plain exception if an import fails in a worker."""

    client = MagicMock()
    client.run.side_effect = [answer]
    monkeypatch.setattr("distributed.Client", lambda *_, **__: client)
    with (
        pytest.raises(InputError, match=f"expected workers with dicedesign .*{message}"),
        cluster_workers("tcp://127.0.0.1:1"),
    ):
        pass
    client.close.assert_called()


def test_without_distributed_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    message = r"--scheduler: expected the optional extra 'cluster', .*'dicedesign\[cluster\]'"
    with pytest.raises(InputError, match=message), cluster_workers("tcp://127.0.0.1:1"):
        pass
