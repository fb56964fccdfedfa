"""Proposals and questions of the reader: folders, roles of columns, runs in a table, answers."""
