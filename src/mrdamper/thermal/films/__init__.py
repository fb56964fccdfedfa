"""Heat transfer from surfaces: properties of air, correlations, coefficients of a geometry."""
