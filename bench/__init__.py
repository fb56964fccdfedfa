"""Benchmarks, which are not installed. ``python -m bench [NAME ...]`` prints a table and writes JSON."""
