"""Thermal models of a damper (network, reduced, finite-element) and their time stepping."""
