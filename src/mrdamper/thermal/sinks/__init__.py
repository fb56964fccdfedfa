"""Heat sinks: search of the best design, effect of a design, and uncertainty of the effect."""
