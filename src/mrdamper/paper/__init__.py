"""Comparison of simulated results (``mrdamper demo``) with the claims of the reference paper."""
