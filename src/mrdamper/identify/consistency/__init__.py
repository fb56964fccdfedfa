"""Consistency test of a campaign: find runs and groups of runs that deviate from a model fitted to all runs.

The module ``effects`` estimates the size of possible causes from the residuals of a fit. ``runs`` finds
deviating single runs, and ``groups`` finds deviating groups of runs. ``joint`` fits the model if there is no
card yet.
"""
