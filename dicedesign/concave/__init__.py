"""Concave dice: closed surfaces deformed until their convex hull has the target probabilities."""
