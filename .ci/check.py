"""Steps of `.ci/run` and, with --nightly, of `.ci/nightly`; a table of their seconds ends each.

Steps that need one core run in the background, beside those that use all. Everything is made in a
temporary folder from what git knows, by one wheel that is built once.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

LOWEST_EXTRAS = "bench,cluster,parquet,concave"
"""Extras that are tested at their lowest versions."""

TESTERS = "pytest pytest-xdist hypothesis filelock lib3mf pygltflib"
"""What tests need beside the package, where not all of the extra test can be installed."""

WITHOUT_TORCH = """
    tests/runtime tests/kernels tests/geometry/meshes tests/geometry/hulls/test_hull.py
    tests/rest/test_basins.py tests/rest/test_poses.py tests/rest/test_outcomes.py
    tests/throws/test_engines.py tests/fabricate/test_label_art.py
    tests/fabricate/test_file_formats.py tests/report/test_charts.py
"""
"""Tests that other Pythons run, for which torch would be a download of gigabytes."""

LOWEST = """
    tests/geometry/meshes/test_reading.py tests/geometry/meshes/test_body.py
    tests/geometry/surfaces/test_closed_surface.py tests/fabricate/test_engraving.py
    tests/fabricate/test_file_formats.py tests/report/test_charts.py tests/recipe/test_recipe.py
    tests/recipe/test_pipeline.py::test_a_recipe_becomes_a_checked_die
    tests/concave/test_paper_fill.py tests/batch/test_rest_table.py
    tests/runtime/test_executors.py
"""
"""Tests of what reaches into dependencies, run with their lowest versions."""

KERNELS = """
    tests/geometry/hulls tests/rest tests/gradient tests/optimize/test_coordinates.py
    tests/optimize/test_energy.py tests/optimize/solvers/test_exact.py
"""
"""Tests of what kernels compute, run again by their twins in Python."""

CONVEX = "tests/recipe/test_recipes.py::test_a_recipe_gives_its_die_with_little_work"

BENCHES = "stability gradients accuracy speed gallery"
"""Benches whose short forms are short; the nightly check runs all."""


class Check:
    """Steps in a temporary folder.

    Attributes
    ----------
    work: the folder. tree: in it, the source distribution, with a virtual environment.
    """

    def __init__(self, work: Path) -> None:
        self.work = work
        self.tree = work / "tree"
        self.begun = time.monotonic()
        self.rows: list[tuple[str, float, str]] = []
        self.failed: list[str] = []
        self.background: list[threading.Thread] = []
        self.quiet = threading.local()

    def say(self, text: str) -> None:
        print(text, flush=True)

    @contextmanager
    def step(self, title: str) -> Iterator[None]:
        """Time a step; what it prints in the background appears when it ends."""
        is_background = getattr(self.quiet, "log", None) is not None
        if not is_background:
            self.say(f"\n== {title} (after {time.monotonic() - self.begun:.0f} s)")
        start, ending = time.monotonic(), "failed"
        try:
            yield
            ending = ""
        finally:
            where = "beside others" if is_background else ""
            self.rows.append((title, time.monotonic() - start, f"{where} {ending}".strip()))
            if ending:
                self.failed.append(title)
            if is_background:
                log = self.quiet.log
                log.seek(0)
                self.say(f"\n== {title} (in the background)\n{log.read()}")
                log.seek(0)
                log.truncate()

    def call(self, command: str, folder: Path | None = None, **environment: str) -> None:
        """Run a shell command, in the tree unless another folder is given."""
        log = getattr(self.quiet, "log", None)
        streams = {} if log is None else {"stdout": log, "stderr": subprocess.STDOUT}
        subprocess.run(
            ["bash", "-euo", "pipefail", "-c", command],
            cwd=folder or self.tree,
            env={**os.environ, "WORK": str(self.work), **environment},
            stdin=subprocess.DEVNULL,
            check=True,
            **streams,
        )

    def beside(self, *steps: Callable[[], None]) -> threading.Thread:
        """Start steps in the background, one after the other."""

        def run() -> None:
            with tempfile.TemporaryFile("w+") as self.quiet.log:
                for each in steps:
                    try:
                        each()
                    except (subprocess.CalledProcessError, OSError) as error:
                        self.say(f"failed: {error}")
                        return

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        self.background.append(thread)
        return thread

    def join(self) -> None:
        """Wait for the background. Raises SystemExit if anything failed."""
        for thread in self.background:
            thread.join()
        if self.failed:
            raise SystemExit(1)

    def table(self) -> None:
        """Print the seconds of each step."""
        self.say("\nseconds  step")
        for title, seconds, remark in self.rows:
            self.say(f"{seconds:7.0f}  {title}{remark and f' ({remark})'}")
        self.say(f"{time.monotonic() - self.begun:7.0f}  in all")

    # Steps.

    def build(self) -> None:
        """One source distribution and one wheel, of all that git knows."""
        with self.step("the source distribution, and one wheel for all environments"):
            self.tree.mkdir()
            self.call(
                """
                mkdir "$WORK/source"
                git archive HEAD | tar -x -C "$WORK/source"
                python3 -m venv "$WORK/builder"
                "$WORK/builder/bin/pip" install --quiet build
                "$WORK/builder/bin/python" -m build --outdir "$WORK/dist" "$WORK/source"
                tar -xz -C "$WORK/tree" --strip-components 1 -f "$WORK"/dist/dicedesign-*.tar.gz
                diff <(git ls-tree -r --name-only HEAD | sort) \
                  <(cd "$WORK/tree" && find . -type f ! -path ./PKG-INFO -printf '%P\\n' | sort)
                """,
                ROOT,
            )

    @property
    def wheel(self) -> Path:
        return next((self.work / "dist").glob("*.whl"))

    def readme(self, pattern: str) -> list[str]:
        """Parts of a command of the README, which install the wheel instead of the folder."""
        line = re.search(pattern, (ROOT / "README.md").read_text(), re.MULTILINE)[0]
        wheel = f"install --quiet '{self.wheel}"
        line = line.replace("install .", f"{wheel}'").replace("install '.", wheel)
        return line.split(" && ")

    def programs(self) -> None:
        """Slicer and browser, where apt can install them: their tests are then required."""
        with self.step("prusa-slicer and chromium, from Debian's packages"):
            missing = [name for name in ("prusa-slicer", "chromium") if shutil.which(name) is None]
            if missing and os.getuid() == 0 and shutil.which("apt-get") is not None:
                self.call(
                    f"""
                    export DEBIAN_FRONTEND=noninteractive
                    apt-get update -qq || exit 0
                    for program in {" ".join(missing)}; do
                      apt-get install -qq -y --no-install-recommends "$program" > /dev/null \
                        || echo "$program cannot be installed here"
                    done
                    """
                )

    def required(self) -> str:
        """Options of pytest for what is there."""
        options = []
        if (ROOT.parent / "shared").is_dir():
            # Public data, where it lies beside the checkout, is found beside this copy too.
            (self.work / "shared").symlink_to((ROOT.parent / "shared").resolve())
            options.append("--require-public-data")
        for option, program in (("slicer", "prusa-slicer"), ("browser", "chromium")):
            if shutil.which(program) is not None:
                options.append(f"--require-{option}")
            else:
                self.say(f"skipped: tests with {program}, which is not installed here")
        return " ".join(options)

    def examples(self) -> None:
        """All examples in one process, where no extra is installed."""
        with self.step("the examples, from the README's first installation"):
            self.call(
                """
                .venv/bin/python -P -c '
                import runpy, sys
                for path in sys.argv[1:]:
                    print("==", path, flush=True)
                    sys.argv = [path]
                    runpy.run_path(path, run_name="__main__")
                ' $(ls examples/*.py | grep -v _engine.py)
                """.replace("                ", "")
            )

    def processors(self) -> list[dict[str, str]]:
        """Environments in which linear algebra rounds as on two kinds of processors.

        What a processor lacks it cannot stand in for: those are an illegal instruction.
        """
        flags = set(Path("/proc/cpuinfo").read_text().split())
        newer = {"OPENBLAS_CORETYPE": "Haswell", "ATEN_CPU_CAPABILITY": "avx2"}
        other = "SkylakeX" if "avx512f" in flags else "Nehalem"
        return [
            newer if "avx2" in flags else {},
            {"OPENBLAS_CORETYPE": other, "ATEN_CPU_CAPABILITY": "default"},
        ]

    def site(self) -> None:
        with self.step("the documentation as a site, every warning an error"):
            self.call(
                """
                python3 -m venv "$WORK/docs"
                python3 .ci/requirements.py docs | grep -i mkdocs > "$WORK/docs.txt"
                "$WORK/docs/bin/pip" install --quiet --requirement "$WORK/docs.txt"
                "$WORK/docs/bin/mkdocs" build --strict --quiet --site-dir "$WORK/site"
                """
            )

    def lint(self) -> None:
        with self.step("lint, format, types"):
            self.call(".venv/bin/ruff check . && .venv/bin/ruff format --check . && .venv/bin/mypy")

    def without_compiler(self) -> None:
        with self.step("the package is built without its kernels where there is no compiler"):
            self.call(
                """
                CC=false CXX=false .venv/bin/pip wheel --quiet --no-deps --wheel-dir wheels .
                ls wheels/dicedesign-*-none-any.whl
                """
            )

    def lowest(self) -> None:
        """Except of torch: its oldest wheels bring gigabytes for other processors."""
        with self.step("the lowest versions of the dependencies, without kernels"):
            self.call(
                f"""
                python3 -m venv "$WORK/lowest"
                pinned="$WORK/lowest.txt"
                python3 .ci/requirements.py --lowest {LOWEST_EXTRAS.replace(",", " ")} > "$pinned"
                "$WORK/lowest/bin/pip" install --quiet --no-compile --constraint "$pinned" \
                  "$(ls "$PWD"/wheels/dicedesign-*-none-any.whl)[{LOWEST_EXTRAS}]" {TESTERS}
                # Old releases use what newer ones of their own dependencies deprecate.
                "$WORK/lowest/bin/pytest" -n 1 -W ignore::DeprecationWarning \
                  {" ".join(LOWEST.split())}
                """
            )

    def python(self, version: str, python: str) -> None:
        """Tests without torch by another Python."""
        with self.step(f"Python {version}"):
            self.call(
                f"""
                {python} -m venv "$WORK/{version}"
                cd "$WORK/{version}/bin"
                ./python "$WORK/tree/.ci/requirements.py" bench > ../needed.txt
                ./pip install --quiet --no-compile --only-binary :all: \
                  --requirement ../needed.txt {TESTERS}
                ./pip install --quiet --no-deps "$WORK"/dist/dicedesign-*.tar.gz
                cd "$WORK/tree"
                "$WORK/{version}/bin/pytest" -n 1 -p no:cacheprovider \
                  {" ".join(WITHOUT_TORCH.split())}
                """
            )

    def benches(self, names: str = BENCHES) -> None:
        with self.step("benches in short form"):
            self.call(f".venv/bin/python -m benchmarks all --quick {names}")

    def without_kernels(self, tests: str) -> None:
        with self.step("what kernels compute, without them"):
            self.call(f".venv/bin/pytest --without-kernels {tests}")


def other_pythons() -> dict[str, str]:
    """Pythons of this machine beside the one that runs, newest first: path by version."""
    found = {}
    for minor in (14, 13, 12, 11):
        candidates = [f"python3.{minor}"]
        candidates += map(str, Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python"))
        for path in candidates:
            can_install = ["-c", "import ensurepip, venv"]
            if shutil.which(path) is not None and minor != sys.version_info.minor:
                if subprocess.run([path, *can_install], capture_output=True).returncode == 0:
                    found[f"3.{minor}"] = path
                    break
    return found


def run(check: Check) -> None:
    programs = check.beside(check.programs)
    check.build()
    create, install, make = check.readme("^python3 -m venv .*dicedesign run.*")
    with check.step("the README's first command"):
        check.call(f"{create} && {install} && {make}")
        check.call(".venv/bin/python tests/check_outputs.py outputs/2d6_hendecahedron")
    check.examples()
    create, install, test = check.readme(r"^python3 -m venv .*\[test\].*")
    with check.step("the README's second command: installation"):
        check.call(f"{create} && {install}")
    programs.join()
    options = check.required()
    newest = list(other_pythons().items())[:1]
    check.beside(
        check.without_compiler,
        check.lint,
        check.site,
        check.lowest,
        *(partial(check.python, *python) for python in newest),
        check.benches,
    )
    with check.step("the README's second command: tests"):
        check.call(test, PYTEST_ADDOPTS=options)
    with check.step("slow second judges"):
        check.call(".venv/bin/pytest -m full", PYTEST_ADDOPTS=options)
    # Linear algebra rounds differently on other processors, and dice may not hang on that. Those
    # for a table are chosen by random throws, and concave ones by a search: they run on one.
    first, second = check.processors()
    with check.step("every shipped recipe, made and read back"):
        check.call(".venv/bin/pytest -m shipped", **first)
    with check.step("the convex ones, as another kind of processor rounds"):
        check.call(f".venv/bin/pytest -m shipped {CONVEX}", **second)
    check.without_kernels(" ".join(KERNELS.split()))


def run_nightly(check: Check) -> None:
    check.build()
    create, install, _ = check.readme(r"^python3 -m venv .*\[test\].*")
    with check.step("installation"):
        check.call(f"{create} && {install}")
    check.required()
    check.beside(*(partial(check.python, *python) for python in list(other_pythons().items())[1:]))
    check.without_kernels("")
    with check.step("twenty thousand random bodies"):
        check.call(".venv/bin/pytest tests/fuzz --hypothesis-profile=nightly")
    check.join()
    check.benches("")


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        check = Check(Path(folder))
        try:
            (run_nightly if "--nightly" in sys.argv else run)(check)
            check.join()
        except (subprocess.CalledProcessError, SystemExit) as error:
            print(f"\nfailed: {', '.join(check.failed)}\n{error}", file=sys.stderr)
            return 1
        finally:
            check.table()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
