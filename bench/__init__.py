"""Benchmarks: ``python -m bench [NAME ...]`` prints a table and writes JSON. Not part of the package."""
