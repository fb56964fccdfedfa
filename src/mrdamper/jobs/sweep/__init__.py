"""Sweeps: many independent tasks, each for one campaign, one random damper or one geometry file.

The tasks run on processes of this machine or on a Dask cluster.
"""
