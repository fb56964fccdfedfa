"""Heating and heat sinks: drawing, correlations, zone network, rise."""
