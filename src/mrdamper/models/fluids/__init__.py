"""MR fluids: viscosity and yield stress versus temperature and field, presets, fits of rheometer tables."""
