"""A rheometer's table of viscosity: three laws fitted, the best first, and how far the viscosity falls."""

import numpy as np

from mrdamper.models.fluids.viscosity_fit import fit_viscosity

celsius = np.arange(20.0, 131.0, 10.0)
millipascal_s = np.array([117.9, 98.3, 82.6, 70.9, 59.7, 52.7, 45.7, 40.9, 36.2, 32.4, 28.9, 25.8])

study = fit_viscosity(celsius + 273.15, 1e-3 * millipascal_s)
for fit in study.fits:
    fall, error = fit.fall_percent()
    name = type(fit.factor).__name__
    print(f"{name:9} rms {fit.rms_percent:5.2f} %, AICc {fit.aicc:6.1f}, falls by {fall:.1f} ± {error:.2f} %")
for number in study.best.parameters:
    print(number)
