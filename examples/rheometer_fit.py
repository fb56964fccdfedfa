"""Fit three viscosity laws to a rheometer table; print the decrease of the viscosity from 20 to 100 degC."""

import numpy as np

from mrdamper.models.fluids.fits import fit_viscosity

celsius = np.arange(20.0, 131.0, 10.0)
millipascal_s = np.array([117.9, 98.3, 82.6, 70.9, 59.7, 52.7, 45.7, 40.9, 36.2, 32.4, 28.9, 25.8])

study = fit_viscosity(celsius + 273.15, 1e-3 * millipascal_s)
for fit in study.fits:
    error = fit.fall_standard_error_percent
    print(f"{fit.name:9} rms {fit.rms_percent:5.2f} %, falls by {fit.fall_percent:.1f} ± {error:.2f} %")
for parameter in study.best.parameters:
    print(parameter)
