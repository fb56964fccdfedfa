"""Diagnosis of a run before it is fitted: faults, their location and size, and their effect on a fit.

Each function generates findings of one kind. Modules: ``timing`` (time stamps), ``sensors`` (single
channels), ``mechanics`` (force and motion), ``resolution`` (samples, noise, cycles). The function
``diagnose`` uses the modules in this order. No data are changed.
"""
