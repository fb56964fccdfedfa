"""Comparison of the demo on the virtual rig with the claims and figures of the paper."""
