"""Benches run as by the command line, on as little as a test wants."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from common.inline_executor import Inline
from dicedesign.bench.frame import BENCHES, add_options, execute


def run_bench(name: str, *arguments: object, extent: Any = None) -> int:
    """The exit code. extent: how much is measured; the work of processes is done in this one."""
    bench = BENCHES[name]
    if extent is not None:
        bench = replace(bench, full=extent, quick=extent, results=None)
    parser = argparse.ArgumentParser()
    parser.set_defaults(engine="native")
    add_options(parser, bench)
    return execute(bench, parser.parse_args([str(one) for one in arguments]), Inline())
