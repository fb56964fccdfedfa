"""Sweeps: one task for each campaign, random damper or geometry file, on processes or on a Dask cluster."""
