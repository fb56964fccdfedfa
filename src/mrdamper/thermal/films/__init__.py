"""Heat transfer from surfaces: properties of air, correlations, films of a drawing's faces."""
