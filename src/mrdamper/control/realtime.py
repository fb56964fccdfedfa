"""Real-time model of the damper: displacement, current and temperature in, force out.

The model has the same tables, configuration and C code as the controllers (``core/kernel/track_model.h``).
Use the model for hardware in the loop, co-simulation, or as a virtual force sensor. Do not use the model for
fitting, because its tables approximate the hysteresis law. ``models.simulate`` uses the hysteresis law
itself.

In each input row, the current is the current during the past sampling period, and the other values are
readings at its last moment. If the velocity is given, the model uses displacement and velocity unfiltered.
Otherwise the motion filter of the controllers estimates the velocity. By default, this filter is designed for
a displacement without noise. For a sensor with 10 um noise, pass the arguments
``displacement_noise_m=10e-6, jerk_density=1.0``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.control import tuning
from mrdamper.control.controllers import (
    Safety,
    base_configuration,
    check_period,
    envelope_of,
    tables_of,
)
from mrdamper.control.settings import SETTINGS
from mrdamper.control.stepper import Stepper
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper


@dataclass(frozen=True, slots=True, eq=False)
class RealtimeDamper(Stepper):
    """Real-time model of a damper: a step returns the next state and the force [N].

    The force is finite for all inputs. Flags report invalid inputs.
    """

    def step(
        self, state: bytes, displacement: float, velocity: float | None, current: float, temperature: float
    ) -> tuple[bytes, float]:
        """Return the next state and the force [N]. Equal arguments give equal results.

        Parameters
        ----------
        displacement : [m]
        velocity : [m/s]; None or NaN: estimated from the displacement
        current : current during the period that ends now [A or V]
        temperature : [K]
        """
        return self._native.model(state, displacement, velocity, current, temperature)

    def run(self, state: bytes, rows: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Compute n steps; return the last state, n forces [N] and the flags of n steps.

        ``rows`` has shape (n, 4). Its columns are displacement [m], velocity [m/s] or NaN, current [A or V]
        and temperature [K].
        """
        inputs = np.ascontiguousarray(rows, dtype=np.float64)
        if inputs.ndim != 2 or inputs.shape[1] != 4:
            raise InputError(
                place="real-time model", found=f"rows have shape {inputs.shape}", expected="(n, 4)"
            )
        return self._native.simulate(state, inputs)


def realtime_model(  # noqa: PLR0913 - values that a caller can know better than the rules
    source: ModelCard | Damper,
    *,
    period_s: float = 1e-3,
    largest: float | None = None,
    displacement_noise_m: float = SETTINGS.model_noise_m,
    jerk_density: float = SETTINGS.model_jerk_density,
    safety: Safety | None = None,
    heating: Heating | None = None,
    extrapolate_temperature: bool = False,
    speed_m_s: float = 1.0,
    single: bool = False,
) -> RealtimeDamper:
    """Return the real-time model of a damper, made from a model card or a damper.

    Parameters
    ----------
    period_s : sampling period [s]
    largest : largest current [A or V]; None: the largest command of the driver in the card; if unknown, the
        largest command in the runs
    displacement_noise_m, jerk_density : sensor noise [m] and jerk density of the motion [m/s^3 per root Hz],
        for the design of the motion filter
    safety : limits of valid readings; None: the default
    heating : heat balance that detects a stuck thermometer; None: heat balance of the damper in the reference
        paper; ``NO_HEATING``: no detection
    extrapolate_temperature : True: if the thermometer is stuck, the temperature is estimated from the
        supplied energy, as in a controller. False: the model sets a flag and uses the constant reading,
        because the temperature in a simulation can be constant without a fault
    speed_m_s : maximum speed of the tables [m/s]
    single : True for single precision

    Raises
    ------
    InputError
        If no tables exist for the hysteresis law, the largest command is unknown, or the dead time has too
        many periods.
    """
    check_period("real-time model", period_s)
    damper = source.damper if isinstance(source, ModelCard) else source
    actuation = tuning.actuation_of(damper)
    # A motion filter that assumes a harmonic motion gives more accurate forces for the hysteresis law
    # ``chain``. This is true even for a random road motion (RMS error of 0.8 instead of 1.1 %).
    is_harmonic = damper.law.name == "chain"
    motion = tuning.motion_of(period_s, period_s, displacement_noise_m, jerk_density, is_harmonic=is_harmonic)
    tables = tables_of(source, actuation, period_s=period_s, largest=largest, speed_m_s=speed_m_s)
    base = base_configuration(
        tables,
        period_s,
        safety or Safety(),
        envelope_of(source),
        motion=motion,
        actuation=tuning.sampled_actuation(actuation, period_s),
        heating=(heating or Heating.paper()).config(damper.command_unit, extrapolate=extrapolate_temperature),
    )
    return RealtimeDamper(base, tables, single)
