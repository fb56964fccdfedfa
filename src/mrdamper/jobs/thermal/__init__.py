"""Jobs on heat: heating, derating and heat sinks."""
