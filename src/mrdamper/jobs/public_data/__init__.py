"""Public data sets: the catalogue, and the channel maps that come with the package."""
