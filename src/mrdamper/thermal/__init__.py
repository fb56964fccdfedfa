"""Heating and heat sinks: geometry, correlations, thermal models, temperature rise."""
