"""Models: hysteresis laws, their coefficients' dependence on the command, the damper, simulation, the card."""
