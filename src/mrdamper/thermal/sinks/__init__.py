"""The search of heat sinks."""
