"""Thermal models with a few states for controllers."""
