"""Measurements of the product, and training of its momentum model: `python -m benchmarks NAME`."""
