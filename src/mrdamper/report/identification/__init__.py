"""Sections of the identification report."""
