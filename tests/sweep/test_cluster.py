"""Commands on an encrypted Dask cluster: a scheduler and two workers as processes of this machine.

The tests share one cluster. The third kills a worker, the fourth all processes.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext, suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path

import dask
import pytest
import trimesh
from common.inline_executor import Inline
from common.kernels import compiled_only
from distributed import Client

from dicedesign.cli.main import main
from dicedesign.errors import DiceError, InputError
from dicedesign.runtime import workers
from dicedesign.runtime.workers import cluster_workers, in_order

PATIENCE = 60.0

TLS = "distributed.comm.tls"
"""Key of the certificates in Dask's configuration."""

Cluster = tuple[str, list[subprocess.Popen[bytes]]]
"""Address, and processes, the scheduler last."""


def make_certificate(folder: Path) -> dict[str, str]:
    """Make a self-signed certificate; returns Dask's configuration."""
    key, certificate = str(folder / "key.pem"), str(folder / "certificate.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=cluster"]
    files = ["-keyout", key, "-out", certificate]
    subprocess.run([*command, *files], check=True, capture_output=True)
    configured = {f"{TLS}.ca-file": certificate}
    for role in ("scheduler", "worker", "client"):
        configured |= {f"{TLS}.{role}.cert": certificate, f"{TLS}.{role}.key": key}
    return configured


@pytest.fixture(scope="session")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Cluster of two workers of one thread."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make certificates with")
    folder = tmp_path_factory.mktemp("cluster")
    configured = make_certificate(folder)
    # A task fails with its worker; commands retry it.
    environment = {**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    for name, value in configured.items():
        environment[f"DASK_{name.upper().replace('.', '__').replace('-', '_')}"] = value
    place, log = folder / "scheduler.json", folder / "log"
    local = ("--protocol", "tls", "--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
    file = ("--scheduler-file", str(place))
    with ExitStack() as stack:

        def start(*arguments: str) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-m", "dask", *arguments, *local, *file]
            output = stack.enter_context(log.open("ab"))
            process = subprocess.Popen(command, stdout=output, stderr=output, env=environment)
            stack.callback(process.wait, PATIENCE)
            stack.callback(process.kill)
            return process

        scheduler = start("scheduler", "--port", "0")
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
        processes = [*(start("worker", *options) for _ in range(2)), scheduler]
        deadline, address = time.monotonic() + PATIENCE, None
        while address is None:
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
            # The file may be missing or incomplete.
            with suppress(FileNotFoundError, json.JSONDecodeError):
                address = json.loads(place.read_text())["address"]
        assert address.startswith("tls://")
        stack.enter_context(dask.config.set(configured))
        with Client(address, timeout=PATIENCE, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        yield address, processes


def rows_of(table: Path) -> list[dict[str, str]]:
    with table.open(newline="") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


@compiled_only
@pytest.mark.full
def test_results_are_those_of_one_process(
    tmp_path: Path, recipe_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "local_workers", lambda jobs: nullcontext(Inline()))
    address, _ = cluster
    (tmp_path / "meshes").mkdir()
    for name, height in (("a.stl", 1.5), ("b.obj", 2.5)):
        trimesh.creation.box((1.0, 1.2, height)).export(tmp_path / "meshes" / name)
    rest = ["rest", str(tmp_path / "meshes")]
    sweep = ["sweep", str(recipe_path), "--seeds", "1"]
    for place, options in (("there", ["--scheduler", address]), ("here", [])):
        assert main([*rest, *options, "--out", str(tmp_path / f"{place}.csv")]) == 0
        assert main([*sweep, *options, "--out", str(tmp_path / place)]) == 0
    assert rows_of(tmp_path / "there.csv") == rows_of(tmp_path / "here.csv")
    for name in ("sweep.csv", "index.html", "seed-0/result.json", "seed-0/die_plain.stl"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()


def test_workers_need_this_version(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    for package, found in (("dicedesign", version("dicedesign")), ("no_such_package", "None")):
        monkeypatch.setattr(workers, "PACKAGE", package)
        monkeypatch.setattr(workers, "version", lambda name: "9.9")
        message = f"expected workers with {package} 9.9, got {found}; install that version"
        with pytest.raises(InputError, match=message), cluster_workers(cluster[0]):
            pass


def die_once(file: str, number: int) -> int:
    """Kill this process, unless another one has made a file."""
    with suppress(FileExistsError), open(file, "x", encoding="utf-8"):
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def test_tasks_of_a_lost_worker_are_run_again(tmp_path: Path, cluster: Cluster) -> None:
    address, processes = cluster
    tasks = [partial(die_once, str(tmp_path / "died"), number) for number in range(9)]
    with cluster_workers(address) as (executor, threads):
        assert threads == 2
        assert list(in_order(tasks, executor)) == [number**2 for number in range(9)]
    assert sum(process.poll() == -signal.SIGKILL for process in processes) == 1


def test_a_scheduler_that_ends(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    address, processes = cluster
    monkeypatch.setattr(workers, "PATIENCE", 2.0)
    with cluster_workers(address) as (executor, _):
        for process in processes:
            process.kill()
        processes[-1].wait(PATIENCE)
        with pytest.raises(DiceError, match="expected a Dask scheduler until the end"):
            list(in_order([partial(pow, number, 2) for number in range(9)], executor))


@pytest.mark.parametrize("protocol", ["tcp", "tls"])
def test_a_scheduler_that_does_not_answer(
    tmp_path: Path,
    recipe_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    protocol: str,
) -> None:
    """Nobody listens, or certificates are missing."""
    monkeypatch.setattr(workers, "PATIENCE", 0.1)
    sweep = ["sweep", str(recipe_path), "--seeds", "1", "--out", str(tmp_path / "out")]
    missing = {f"{TLS}.ca-file": "missing.pem", f"{TLS}.client.cert": "missing.pem"}
    with dask.config.set(missing):
        assert main([*sweep, "--scheduler", f"{protocol}://127.0.0.1:9"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "expected a Dask scheduler that answers" in line
    assert "certificates of tls://" in line
    assert not (tmp_path / "out").exists()


def test_without_distributed_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    message = r"--scheduler: expected the optional extra 'cluster', .*'dicedesign\[cluster\]'"
    with pytest.raises(InputError, match=message), cluster_workers("tcp://127.0.0.1:1"):
        pass
