"""Models: hysteresis laws, coefficients as functions of the command, damper, simulation and model card."""
