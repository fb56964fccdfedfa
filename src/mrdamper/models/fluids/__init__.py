"""MR fluids: viscosity and yield stress over temperature and field, presets, fits to rheometer tables."""
