"""Measured runs: records, readers, channel maps, preparation, diagnosis and cycles."""
