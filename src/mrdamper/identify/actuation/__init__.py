"""Identify the actuation, which is the delay, lags and hysteresis between command and force.

The data are runs with a changing command (current or voltage). The force law is fitted before, to runs with
constant command, and is not changed here.

In all modules of this package, the variable ``still`` is the damper without delay and lags.

The fitted lags are valid only near the speed v of the fitted runs. The reason is that the force F also builds
up against the stiffness s of the damper, with the time constant F / (s v). A law with the coefficient
``follow_share`` models this effect: the coefficient is the fraction of the force that follows the command
immediately. The fraction is fitted to all runs, together with the lags.
"""

from mrdamper.identify.actuation.fit import ActuationFit, fit_actuation, refine_actuation
from mrdamper.identify.actuation.settings import ActuationSettings

__all__ = ["ActuationFit", "ActuationSettings", "fit_actuation", "refine_actuation"]
