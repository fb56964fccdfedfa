"""Models: laws, coefficients as functions of the command, the damper, simulation, the card."""
