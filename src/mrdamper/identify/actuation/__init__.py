"""Identify the actuation, which is the delay, lags and hysteresis between command and force.

The identification requires runs with a changing command (current or voltage). The force law of the damper is
fitted before, to runs with constant command, and is not changed here.

1. ``fit_actuation`` fits delay, rise, fall and second lag (``least_squares``). The data are step responses
   (``step_responses``) if the command is constant between steps, otherwise whole runs. The magnetic
   hysteresis is fitted afterwards.
2. ``refine_actuation`` adds core saturation, a second hysteresis loop and free-wheeling.

In all modules of this package, the variable ``still`` is the damper without delay and lags.

The fitted lags are valid only near the speed v of the fitted runs. The reason is that the force F also builds
up against the stiffness s of the damper, with the time constant F / (s v). A law with the coefficient
``follow_share`` models this effect: the coefficient is the fraction of the force that follows the command
immediately. The fraction is fitted to all runs, together with the lags.
"""

from mrdamper.identify.actuation.fit import ActuationFit, fit_actuation, refine_actuation
from mrdamper.identify.actuation.settings import ActuationSettings

__all__ = ["ActuationFit", "ActuationSettings", "fit_actuation", "refine_actuation"]
