"""Uncertainty of a fit: force band, standard errors, bootstrap, posterior samples, proposed tests."""
