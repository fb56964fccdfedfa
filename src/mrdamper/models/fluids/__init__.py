"""MR fluids: viscosity and yield stress versus temperature and field, presets, fits to rheometer tables."""
