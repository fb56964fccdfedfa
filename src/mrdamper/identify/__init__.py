"""Identification: from prepared runs to coefficients with errors that can be believed."""
