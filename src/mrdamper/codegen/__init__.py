"""Export of a model card for a target: C source, FMU and force map, verified before they are written."""
