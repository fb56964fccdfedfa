"""Heat sinks: search for the best design, effect of a design, and uncertainty of the effect."""
