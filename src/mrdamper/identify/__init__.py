"""Identification: from prepared runs to coefficients and their standard errors."""
