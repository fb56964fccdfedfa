"""Benchmarks, not part of the package: ``python -m bench [NAME ...]`` prints a table and writes JSON."""
