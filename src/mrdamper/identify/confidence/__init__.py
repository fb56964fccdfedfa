"""Uncertainty of a fit: force band, standard errors, posterior samples, proposed tests."""
