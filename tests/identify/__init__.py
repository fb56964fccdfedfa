"""Tests of the identification of dampers from measured runs."""
