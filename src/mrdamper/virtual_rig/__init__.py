"""Virtual test rigs: simulated dampers with known reference values.

The equations of the simulated dampers differ from all identified laws, so that a fit has a realistic model
error.
"""
