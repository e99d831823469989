"""Ways to put a center of mass where it is wanted: cavities, infill, weights."""
