"""Figures: the common style, and what each report draws."""
