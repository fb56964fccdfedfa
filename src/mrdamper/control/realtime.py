"""The damper's model as a real-time target steps it: displacement, current and temperature in, force out.

The same tables, configuration and C as the controllers (``core/kernel/track_model.h``), for hardware in the
loop, a co-simulation, or as a force sensor that is none. Not for fitting: ``models.simulate`` is the law
itself.

The current of a row is taken as held through the period that ends with it. Given a velocity, the model takes
displacement and velocity as they are; without one it estimates it by the controllers' motion filter, made for
a clean displacement: a sensor's noise of 10 um wants ``displacement_noise_m=10e-6, jerk_density=1.0``.
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
from mrdamper.control.stepper import Stepper
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper

DISPLACEMENT_NOISE_M = 1e-8
"""Of the motion filter, where the velocity is not given: a simulation's displacement is clean.

Chosen by measurement on five motions of 0.4 to 20 Hz at 1 kHz: below 1e-7 the force is as good as with the
velocity given, and from 1e-8 on the gains no longer change.
"""

JERK_DENSITY = 30.0
"""Of the motion filter [m/s^3 per root Hz]."""


@dataclass(frozen=True, slots=True, eq=False)
class RealtimeDamper(Stepper):
    """A damper's model: ``step(state, ...)`` gives the next state, which is bytes, and the force [N].

    Whatever it reads, the force is finite, and the flags say what was wrong.
    """

    def step(
        self, state: bytes, displacement: float, velocity: float | None, current: float, temperature: float
    ) -> tuple[bytes, float]:
        """Return the next state and the force [N]; the same arguments give the same answer.

        Parameters
        ----------
        displacement : [m]
        velocity : [m/s]; None or not a number: estimated from the displacement
        current : through the period that ends now [A or V]
        temperature : [K]
        """
        return self._native.model(state, displacement, velocity, current, temperature)

    def run(self, state: bytes, rows: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Take many steps at once; return the last state, the forces [N] and the flags, shape (n,).

        ``rows`` holds displacement [m], velocity [m/s] or NaN, current [A or V] and temperature [K], shape
        (n, 4).
        """
        inputs = np.ascontiguousarray(rows, dtype=np.float64)
        if inputs.ndim != 2 or inputs.shape[1] != 4:
            raise InputError(
                place="real-time model", found=f"rows have shape {inputs.shape}", expected="(n, 4)"
            )
        force, flags = np.empty(len(inputs)), np.empty(len(inputs))
        return self._native.simulate(state, inputs, force, flags), force, flags.astype(np.int64)


def realtime_model(  # noqa: PLR0913 - what a caller may know better than the rules
    source: ModelCard | Damper,
    *,
    period_s: float = 1e-3,
    largest: float | None = None,
    displacement_noise_m: float = DISPLACEMENT_NOISE_M,
    jerk_density: float = JERK_DENSITY,
    safety: Safety | None = None,
    heating: Heating | None = None,
    extrapolate_temperature: bool = False,
    speed_m_s: float = 1.0,
    single: bool = False,
) -> RealtimeDamper:
    """Return the model of a card or damper in the form that a real-time target steps.

    Parameters
    ----------
    period_s : sampling period [s]
    largest : largest current [A or V]; None: the actuation's, else the envelope's
    displacement_noise_m, jerk_density : of the motion filter [m], [m/s^3 per root Hz]
    safety : when readings are not believed; None: the usual
    heating : what tells a frozen thermometer; None: the paper's damper; ``NO_HEATING``: it is not looked for
    extrapolate_temperature : a frozen temperature is carried on by the energy put in, as a controller does.
        Without, it is flagged and used as it is: in a simulation a constant temperature is a choice
    speed_m_s : speed up to which the tables reach [m/s]
    single : in single precision

    Raises
    ------
    InputError
        A law without tables, an unknown largest command, a dead time of too many periods.
    """
    check_period("real-time model", period_s)
    damper = source.damper if isinstance(source, ModelCard) else source
    actuation = tuning.actuation_of(damper)
    # The filter of a motion that swings is more accurate for a chain on a road (0.8 instead of 1.1 % RMS).
    swings = damper.law.name == "chain"
    motion = tuning.motion_of(period_s, period_s, displacement_noise_m, jerk_density, swings=swings)
    tables = tables_of(source, actuation, period_s=period_s, largest=largest, speed_m_s=speed_m_s)
    base = base_configuration(
        tables,
        period_s,
        safety or Safety(),
        envelope_of(source),
        motion=motion,
        actuation=tuning.sampled_actuation(actuation, period_s),
        preview=0.0,
        heating=(heating or Heating.paper()).config(damper.command_unit, extrapolate=extrapolate_temperature),
    )
    return RealtimeDamper(base, tables, single)
