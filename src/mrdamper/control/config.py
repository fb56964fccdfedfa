"""The configuration of a controller, as frozen dataclasses like the structs in ``controller_config.h``.

The C extension reads each value by its name. The export as C code prints the same names. Units are SI and
kelvin. "A" is the unit of the command. If the model card has a voltage as command, the unit is "V" instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum


class InverseMethod(IntEnum):
    """Method by which a controller computes the command from the wanted force."""

    NONE = 0  # The command is computed only by feedback.
    BANK = 1  # interpolation between the forces of models at five constant currents
    PREDICTIVE = 2  # model-predictive control with several command changes in a prediction horizon


class FeedbackKind(IntEnum):
    """Method of feedback for a measured force."""

    NONE = 0
    PI = 1
    ON_OFF = 2  # The sign of the force error selects the largest command or zero.


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """Sampling period, and the ranges of current and temperature in the tables."""

    period: float  # [s] sampling period
    largest: float  # [A] current of the last column of the tables; the first column is 0
    coldest: float  # [K] lowest temperature of the tables
    warmest: float  # [K] highest temperature of the tables


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """The hysteresis model of the damper."""

    series: bool  # True for the hysteresis law ``series-valve``
    chain: bool  # True for the hysteresis law ``chain``
    elements: int  # number of hysteretic elements; 0: the force follows the sign of the velocity
    saturating: bool  # True: second yield force is a function of speed times the state of the first element
    unloaded: float  # [-] normalised travel in which the hysteresis variable w rises from -1 to 0
    substeps: int  # integration steps in a period, for series valve and chain


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Factors on the parts of the force: 1 for the identified damper, other values for an aged damper."""

    yield_force: float = 1.0  # [-] factor on the yield force
    viscous_force: float = 1.0  # [-] factor on the viscous force
    friction_force: float = 1.0  # [-] factor on the friction force


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFilter:
    """Filter that estimates the motion from the displacement.

    In each period, the filter predicts displacement, velocity and acceleration. It then corrects each of them
    by a gain times the displacement error (measured minus predicted).
    """

    gain_x: float  # [-] correction of the displacement, divided by the displacement error
    gain_v: float  # [1/s] correction of the velocity, divided by the displacement error
    gain_a: float  # [1/s2] correction of the acceleration, divided by the displacement error
    holds_readings: bool  # True: the sensor repeats each reading for several periods; repetitions are ignored
    frequency_filter_gain: (
        float  # [-] weight of a new sample in the means of v^2 and a^2; 0: acceleration is assumed constant
    )
    settle_samples: int  # number of periods until the filter has settled
    omega_squared_max: float  # [1/s2] upper limit of the squared frequency, (mean a^2) / (mean v^2)
    velocity_noise_variance: float  # [m2/s2] variance of v caused by sensor noise
    acceleration_noise_variance: float  # [m2/s4] variance of a caused by sensor noise


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceFilter:
    """Filter that extrapolates the wanted force if the future wanted force is unknown.

    In each period, the filter predicts the wanted force and its derivatives. It then corrects each of them by
    a gain times the force error (wanted minus predicted).
    """

    gain_f: float  # [-] correction of the force, divided by the force error
    gain_rate: float  # [1/s] correction of the rate of the force, divided by the force error
    gain_second_derivative: float  # [1/s2] correction of the second derivative, divided by the force error


@dataclass(frozen=True, slots=True, kw_only=True)
class Lags:
    """Two first-order lags between command and flux, for a time interval: a period or a step of the horizon.

    The output of the first lag is the input of the second lag. The *gap* of a lag is its input minus its
    output.
    """

    rise: float  # [-] fraction of the gap of the first lag that remains after the interval, current rising
    fall: float  # [-] the same fraction as ``rise`` while the current falls
    second: float  # [-] fraction of the gap of the second lag that remains after the interval
    rise_couple: float  # [-] fraction of the first gap that the interval adds to the second, current rising
    fall_couple: float  # [-] the same fraction as ``rise_couple`` while the current falls
    second_ramp: float  # [-] second gap at the end of a ramp of the first lag / change in the ramp
    freewheel_ratio: float  # [-] interval / free-wheeling time constant; 0: no free-wheeling


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """Dead time, lags and magnetic hysteresis between command and force."""

    dead_samples: int  # whole periods of the dead time
    dead_part: float  # [-] rest of the dead time, as a fraction of a period
    lags: Lags  # both lags in a period
    inverse_saturation_flux: float  # [1/A] b in the flux I / (1 + b I)
    hysteresis_width: float  # [A] half width of the magnetic hysteresis after the lags
    hysteresis_weight: float  # [-] fraction of the magnetic field with the narrow hysteresis, below 1
    wide_hysteresis_width: float  # [A] half width of a second, wider hysteresis; 0: disabled
    wide_hysteresis_weight: float  # [-] fraction of the field with the wide hysteresis


@dataclass(frozen=True, slots=True, kw_only=True)
class Inverse:
    """Method that computes the command from the wanted force, and its preview time."""

    method: InverseMethod
    preview: float  # [s] time from now to the future wanted force that the caller passes


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Prediction horizon of the model-predictive controller, and costs of its command changes (moves).

    *Step* means a time step of the horizon.
    """

    steps: int  # number of steps of the horizon, which starts after the dead time
    samples: int  # number of periods over which the computation of one prediction is distributed
    together: int  # control periods in one step that integrates the hysteresis law over the dead time
    step: float  # [s] length of a step
    stretch: int  # factor on the step length from the fourth step on
    dead: float  # [s] time from now to the start of the horizon
    fade: float  # [-] error weight of a step divided by the error weight of the previous step
    settled: float  # [-] fraction of the remaining build-up of hysteresis that is assumed to be complete
    calm: float  # [N/A] cost of a command change of one ampere, expressed as a force error
    lags: Lags  # both lags in a step


@dataclass(frozen=True, slots=True, kw_only=True)
class Feedback:
    """Feedback of a measured force: method, gains and disturbance observer."""

    kind: FeedbackKind  # method of feedback
    gain: float  # [A/N] gain of the force error
    rate: float  # [A/(N s)] gain of the integral of the force error
    full_speed: float  # [m/s] speed above which the full gain is used; the gain is smaller at lower speeds
    observe: float  # [-] weight of the force error in each update of the disturbance observer; 0: disabled


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Range of the fitted data. The controller sets a flag for values outside."""

    displacement_min: float  # [m] lowest displacement in the data
    displacement_max: float  # [m] highest displacement in the data
    speed_max: float  # [m/s] highest speed in the data


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """Limits beyond which a displacement or a velocity is a fault."""

    displacement_limit: float  # [m] maximum absolute displacement
    speed_limit: float  # [m/s] maximum absolute velocity
    frozen_samples: int  # This number of equal consecutive readings is a fault.
    frozen_speed_min: float  # [m/s] Equal readings are a fault only if the previous speed was higher.
    coast_samples: int  # samples without displacement until the fall-back command is used
    recovery_samples: int  # samples with displacement until the fall-back ends
    fall_back: float  # [A] command that is used while the motion is unknown


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermometer:
    """Fault limits and filter of the temperature."""

    cold_limit: float  # [K] minimum of a reading
    hot_limit: float  # [K] maximum of a reading
    jump: float  # [K] maximum difference between a reading and the estimate
    change_max: float  # [K] maximum change of the estimate in a period
    filter_decay: float  # [-] fraction of the gap between estimate and reading that remains after a period
    hold_samples: int  # samples for which the estimate is used without a valid reading
    recover_samples: int  # This number of nearly equal readings after a jump is accepted as valid.
    nominal: float  # [K] temperature that is used when there is neither a valid reading nor an estimate
    fixed: float  # [K] temperature used instead of readings; 0: readings are used


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatBalance:
    """Heat balance of the damper as one body, which detects a stuck thermometer (constant reading)."""

    heat_capacity: float  # [J/K] heat capacity; 0: a stuck thermometer is not detected
    loss_conductance: float  # [W/K] thermal conductance to the surroundings
    loss_ratio_max: float  # [-] largest possible heat loss, divided by the loss with ``loss_conductance``
    ambient: float  # [K] temperature of the surroundings
    coil_heat: float  # [W/A2] heat of the coil divided by the square of the applied current
    frozen_rise_max: float  # [K] A constant reading is a fault if the damper should have warmed by more.
    extrapolate: bool  # True: estimate the temperature from the supplied energy while the sensor is stuck


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """All parts of a controller's configuration."""

    axes: Axes
    law: Law
    gains: Gains = Gains()
    motion: MotionFilter
    reference: ReferenceFilter
    actuation: Actuation
    inverse: Inverse
    prediction: Prediction
    feedback: Feedback
    envelope: Envelope
    faults: Faults
    thermometer: Thermometer
    heating: HeatBalance


def compile_options(*configs: Config) -> Mapping[str, int]:
    """Return the compile-time options of C code for only these configurations."""
    return {
        "MRD_WITH_SERIES": int(any(each.law.series for each in configs)),
        "MRD_WITH_CHAIN": int(any(each.law.chain for each in configs)),
        "MRD_WITH_PREDICTION": int(any(each.inverse.method is InverseMethod.PREDICTIVE for each in configs)),
    }
