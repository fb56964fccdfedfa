"""Sections of the report on a fit."""
