"""Sweeps: one job for many test campaigns, random dampers or geometry files.

The tasks are independent. They run on processes of this machine or on a Dask cluster.
"""
