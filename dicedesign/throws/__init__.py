"""Throws of bodies with momentum, simulated, counted and predicted."""
