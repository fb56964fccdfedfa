"""Measured runs: records, readers, channel maps, preparation, cycles, and the public data sets."""
