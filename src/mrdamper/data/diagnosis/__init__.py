"""Diagnosis of a run before it is fitted: faults, their location and size, and their effect on a fit."""
