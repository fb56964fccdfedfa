"""Whole jobs on real runs."""
