"""Comparison of ``mrdamper demo``, a run on simulated data, with the claims of the reference paper."""
