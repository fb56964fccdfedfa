"""Formats whose channels each have a time of their own: universal files, imc FAMOS, HBM catman."""
