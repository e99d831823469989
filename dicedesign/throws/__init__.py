"""Throws: how a body lands that has momentum, simulated, counted and predicted."""
