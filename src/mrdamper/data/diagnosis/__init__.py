"""Diagnosis of a run before it is fitted: what is wrong, where, how much, and what it does to a fit.

One function for each finding, in ``timing`` (time and missing numbers), ``sensors`` (single channels),
``mechanics`` (what belongs together) and ``resolution`` (samples, noise, cycles); ``diagnose`` asks them in
turn. Nothing is repaired here.
"""
