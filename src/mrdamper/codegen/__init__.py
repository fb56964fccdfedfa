"""Export of a model card as C source code, FMU and force map. The code is verified before it is written."""
