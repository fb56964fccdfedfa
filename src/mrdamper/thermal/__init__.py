"""Heating and heat sinks of a damper: geometry, correlations, thermal models, temperature rise."""
