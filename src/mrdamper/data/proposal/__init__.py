"""Interpretation of files: roles of columns, runs in a table, and questions about missing information."""
