"""Settings of controllers and their tests: thresholds, weights and tolerances that affect results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSettings:
    """Settings of design rules (``tuning``), tables, the real-time model, targets and scores."""

    # Motion filter
    jerk_density: float = 1.0  # jerk of the motion model [m/s^3 per root Hz]
    harmonic_jerk_ratio: float = 0.3  # factor on the jerk density if the motion is assumed to be harmonic
    frequency_filter_s: float = 1.0  # time constant of the averages of v^2 and a^2 in the frequency estimate
    # Smallest value of 1 / omega, divided by the time constant of the motion filter. Omega is the angular
    # frequency of the assumed harmonic motion. With a larger omega, the filter could become unstable.
    inverse_frequency_ratio_min: float = 3.0
    settling_ratio: float = 8.0  # settling time of a motion filter / its time constant

    # Motion filter of the real-time model if the velocity is unknown. The displacement of a simulation has no
    # noise. In tests with five motions of 0.4 to 20 Hz at 1 kHz, the force is as accurate as with a given
    # velocity if the assumed noise is below 1e-7 m. Below 1e-8 m, the gains no longer change.
    model_noise_m: float = 1e-8
    model_jerk_density: float = 30.0  # jerk density of the assumed motion [m/s^3 per root Hz]

    # Prediction horizon
    horizon_steps: int = 6
    horizon_ratio: float = 0.8  # completed fraction of the response at the end of the horizon
    freewheel_ratio: float = 0.95  # completed fraction for a current that can only free-wheel down
    freewheel_stretch: int = 3  # length of a late time step / length of an early one, for such a current
    step_ratio_min: float = 0.25  # min time step of the horizon / time constant of the motion filter
    late_ratio_max: float = 0.5  # max time added by rounding up the dead time / time step
    dead_time_stride: float = 2.25  # time step during the dead time / time step of the horizon
    spread_sample_count_max: int = 3  # max number of periods for the computation of one prediction

    # Prediction cost
    horizon_fade: float = 0.8  # weight of a time step / weight of the previous time step
    move_cost_ratio: float = 0.03  # cost of a change of the command / force change that it causes
    move_cost_error_ratio: float = 12.0  # additional cost of a change / force error of the card
    move_cost_ratio_max: float = 0.25  # max cost of a change / force change that it causes
    implicit_move_cost_ratio_max: float = 0.6  # the same maximum for a law with an implicit step
    # Fraction of the remaining build-up of the hysteresis that ``recommended`` assumes to be complete. After
    # a reversal, the force of a Bouc-Wen law builds up too slowly if the current rises, because the state of
    # the law is relative to the yield force. A value of 0 is correct for a damper that is identical to the
    # card. On the virtual dampers of the rig, 0 lets the force overshoot by up to 200 N after each reversal.
    settled_ratio: float = 0.4

    # Other parts of the controllers
    observer_s: float = 0.15  # time constant of the disturbance observer
    series_step_s: float = 1e-3  # max integration step of the series valve
    # A larger command [A or V] sets a flag if the card was fitted only to runs at zero command.
    unpowered_command_max: float = 1e-3
    # Max time without a valid reading for which the temperature estimate is constant, or is extrapolated
    temperature_held_s: float = 10.0
    temperature_extrapolated_s: float = 1800.0

    # Tables of the coefficients
    # Max number of currents in the tables. The multiples of 1/8 of the largest current are always among them.
    current_count_max: int = 41
    current_tolerance: float = 8e-4  # interpolation error / largest yield force
    temperature_tolerance: float = 1e-4  # interpolation error in temperature / size of the coefficient
    temperature_count: int = 193  # number of temperatures at which coefficients are sampled
    rank_tolerance: float = 1e-7
    # Typical values that scale the interpolation errors of stiffness, mass and velocity
    typical_stroke_m: float = 0.05
    typical_acceleration_m_s2: float = 50.0
    low_speed_m_s: float = 0.01
    curve_error: float = 1e-4  # absolute tolerance of a hysteretic state, whose range is -1 to 1
    speed_error: float = 1e-5  # absolute tolerance of a function of speed [m/s if it is viscous, else 1]
    cell_bits_max: int = 6

    # Targets of a damper of any size
    force_percentiles: tuple[float, float] = (2.5, 97.5)  # min and max of the force without short peaks
    sizing_temperature_degC: float = 20.0
    motion_ratio_max: float = 0.8  # stroke and speed of the motion / stroke and speed of the fitted runs

    # Scores. A target is feasible with at least this distance from both ends of the attainable force range.
    margin_N: float = 20.0
    margin_ratio_max: float = 0.025  # max of this distance / peak of the target


SETTINGS = ControlSettings()
