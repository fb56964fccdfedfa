"""Diagnosis of a run before it is fitted: faults, their location and size, and their effect on a fit.

One function computes one finding. Modules: ``timing`` (time and missing numbers), ``sensors`` (single
channels), ``mechanics`` (force and motion), ``resolution`` (samples, noise, cycles). ``diagnose`` calls them
in this order. No data are changed.
"""
