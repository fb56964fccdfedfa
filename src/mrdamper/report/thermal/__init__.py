"""Reports on heating, derating and heat sinks."""
