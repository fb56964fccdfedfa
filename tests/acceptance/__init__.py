"""Tests of complete jobs with measured runs."""
