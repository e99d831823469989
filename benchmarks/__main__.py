"""`python -m benchmarks NAME [--quick]`, from the root of a checkout."""

from __future__ import annotations

import os
import sys

if __name__ == "__main__":
    # Small tensors and matrices: threads only get into each other's way. Child processes inherit
    # this, and libraries read it when they are imported.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    from benchmarks.frame import main

    sys.exit(main(sys.argv[1:]))
