"""Thermal models of a few states: what a controller carries with it."""
