"""Heat transfer from surfaces to air: properties of air, and correlations for heat-transfer coefficients."""
