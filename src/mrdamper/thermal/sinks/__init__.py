"""Search of heat sinks."""
