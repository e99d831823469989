"""`python -m benchmarks NAME [--quick]`, from the root of a checkout."""

from __future__ import annotations

import sys

from benchmarks.frame import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
