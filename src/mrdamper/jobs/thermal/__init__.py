"""Thermal jobs: heating, derating and heat sinks."""
