"""Virtual test rigs: simulated dampers with known reference values.

Their equations differ from all identified laws, so that a fit has a realistic model error.
"""
