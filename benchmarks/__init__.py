"""Measurements of the product, and training of its momentum model: `python -m benchmarks NAME`."""

import os

# Small tensors and matrices: threads only get into each other's way. Child processes inherit this.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
