"""Identify the actuation, which is the delay, lags and hysteresis between command and force.

Runs with a changing command are required. The hysteresis law of the damper is fitted first, to runs with
constant command; the fit of the actuation does not change it. The entry points are

1. ``fit_actuation``: delay, rise, fall and second lag (``least_squares``), from step responses if the command
   is held between its steps (``step_responses``), otherwise from whole runs; then the magnetic hysteresis
   (``hysteresis``).
2. ``refine_actuation``: core saturation, a second hysteresis loop and free-wheeling (``selection``).

In all modules of this package, ``still`` is the damper without actuation. The command is a current or a
voltage.

The lags are valid only near the speed v of these runs. The reason is that the force F also builds up against
the stiffness s of the damper, with the time constant F / (s v). A law with the coefficient ``follow_share``
models this effect: the coefficient is the fraction of the force that follows the command immediately. This
fraction is then fitted to all runs, together with the lags.
"""

from mrdamper.identify.actuation.fit import ActuationFit, fit_actuation
from mrdamper.identify.actuation.selection import refine_actuation
from mrdamper.identify.actuation.settings import ActuationSettings

__all__ = ["ActuationFit", "ActuationSettings", "fit_actuation", "refine_actuation"]
