"""Figures: common style, and the figures of each report."""
