"""Public data sets: catalogue, download, and channel maps that are installed with the package."""
