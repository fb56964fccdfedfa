"""Identification: estimate the coefficients of a damper and their standard errors from prepared runs."""
