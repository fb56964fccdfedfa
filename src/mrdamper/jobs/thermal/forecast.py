"""The job ``forecast``: the first minutes of a heating curve in, the temperatures to come out.

No drawing and no card: a two-node model with stated priors is fitted to the curve
(``thermal.estimation.prediction``). It holds while duty and surroundings stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import InputError, option
from mrdamper.jobs.options import ForecastOptions
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.estimation.prediction import PredictionOptions, predict_temperature
from mrdamper.thermal.estimation.sampling import TimeToLimit

_USUAL = ForecastOptions()


@dataclass(frozen=True, slots=True, eq=False)
class ForecastResult:
    """The temperature to come at the place where the curve was measured, as an interval over time.

    Attributes
    ----------
    curve : what was measured, the part that was used
    time_s : on the curve's clock, shape (n,)
    median_degC, low_degC, high_degC : of the temperature, shape (n,); ``low`` to ``high`` holds it with
    ``probability``
    to_limit : when ``limit_degC`` is reached, on the curve's clock
    """

    curve: HeatingCurve
    time_s: FloatArray
    median_degC: FloatArray
    low_degC: FloatArray
    high_degC: FloatArray
    probability: float
    limit_degC: float
    to_limit: TimeToLimit


def forecast(
    curve: HeatingCurve, options: ForecastOptions = _USUAL, *, on_progress: Progress = silent
) -> ForecastResult:
    """Return what the start of a heating curve says of the rest.

    Raises
    ------
    InputError
        Less than a minute of curve, an end before the curve's own, an ambient that cannot be or is above
        the limit.
    ConvergenceError
        No damper within the priors fits the curve.
    """
    first, last = float(curve.time[0]), float(curve.time[-1])
    until = first + options.until_s
    if until <= last:
        raise InputError(
            place=curve.name,
            found=f"it lasts {last - first:.0f} s",
            expected=f"{options.until_s:g} s of forecast to go beyond it",
        )
    if options.limit_degC <= options.ambient_degC:
        raise InputError(
            place=curve.name,
            found=f"the limit is {options.limit_degC:g} degC, ambient {options.ambient_degC:g} degC",
            expected="a limit above ambient",
            remedy=f"Check {option('limit-degC')} and {option('ambient-degC')}: both are in degC",
        )
    on_progress(ProgressUpdate(total=1, text="dampers that fit the curve"))
    asked = PredictionOptions(
        until=until,
        limit=options.limit_degC + ZERO_CELSIUS_K,
        look=until - last,
        probability=options.probability,
        seed=options.seed,
    )
    found = predict_temperature(curve, options.ambient_degC + ZERO_CELSIUS_K, asked).interval
    median, low, high = (read_only(each - ZERO_CELSIUS_K) for each in (found.median, found.low, found.high))
    return ForecastResult(
        curve,
        found.time,
        median,
        low,
        high,
        probability=options.probability,
        limit_degC=options.limit_degC,
        to_limit=found.to_limit,
    )
