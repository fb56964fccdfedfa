"""Settings of controllers and their tests: thresholds, weights and tolerances that affect results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSettings:
    """Settings of design rules (``tuning``), tables, the real-time model, targets and scores."""

    # Settings of the motion filter
    jerk_density: float = 1.0  # jerk of the motion model [m/s^3 per root Hz]
    harmonic_jerk_ratio: float = 0.3  # factor on the jerk density for an assumed harmonic motion
    frequency_filter_s: float = 1.0  # time constant of the averages of v^2 and a^2 in the frequency estimate
    # Limit of the angular frequency omega of the assumed harmonic motion: 1 / omega must be at least this
    # ratio times the time constant of the motion filter. Otherwise the filter could become unstable.
    inverse_frequency_ratio_min: float = 3.0
    settling_ratio: float = 8.0  # settling time of a motion filter, divided by its time constant

    # Design values of the motion filter in the real-time model, which is used if the velocity is unknown. A
    # simulated displacement has no noise. For five motions of 0.4 to 20 Hz at 1 kHz, a noise below 1e-7 m
    # gave forces as accurate as with a given velocity. Below 1e-8 m, the filter gains no longer change.
    model_noise_m: float = 1e-8
    model_jerk_density: float = 30.0  # jerk density of the assumed motion [m/s^3 per root Hz]

    # Settings of the prediction horizon
    horizon_steps: int = 6
    horizon_ratio: float = 0.8  # The horizon ends when the response to a step has reached this fraction.
    freewheel_ratio: float = 0.95  # current fall within the horizon / whole fall, for a one-quadrant driver
    freewheel_stretch: int = 3  # length of late time steps / length of early time steps, for such a driver
    step_ratio_min: float = 0.25  # shortest time step of the horizon / time constant of the motion filter
    late_ratio_max: float = 0.5  # limit of the time added by rounding up the dead time / time step
    dead_time_stride: float = 2.25  # time step during the dead time / time step of the horizon
    spread_sample_count_max: int = 3  # max number of periods over which one prediction is distributed

    # Settings of the prediction cost
    horizon_fade: float = 0.8  # weight of the force error in a time step / weight in the previous time step
    move_cost_ratio: float = 0.03  # cost of a command change, divided by the force change that it causes
    move_cost_error_ratio: float = 12.0  # additional cost of a command change / force error of the card
    move_cost_ratio_max: float = 0.25  # upper limit of the cost, divided by the force change
    implicit_move_cost_ratio_max: float = 0.6  # like ``move_cost_ratio_max``, for series-valve and chain
    # Assumption of ``recommended`` after a reversal: this fraction of the remaining hysteresis force has
    # already built up. In a Bouc-Wen law with rising current, the force builds up too slowly, because its
    # state is relative to the yield force. A value of 0 is correct for a damper without model error. With 0,
    # the force of the simulated dampers of the virtual rig overshoots by up to 200 N after each reversal.
    settled_ratio: float = 0.4

    # Other parts of the controllers
    observer_s: float = 0.15  # time constant of the disturbance observer
    series_step_s: float = 1e-3  # max integration step of series-valve and chain [s]
    # A larger command [A or V] sets a flag if the card was fitted only to runs at zero command.
    unpowered_command_max: float = 1e-3
    # Time limits without a valid temperature reading: constant estimate, extrapolated estimate
    temperature_held_s: float = 10.0
    temperature_extrapolated_s: float = 1800.0

    # Tables of the coefficients
    # Max number of currents in the tables. The multiples of 1/8 of the largest current are always among them.
    current_count_max: int = 41
    current_tolerance: float = 8e-4  # interpolation error in current, divided by the largest yield force
    temperature_tolerance: float = 1e-4  # interpolation error in temperature, divided by the scale
    temperature_count: int = 193
    rank_tolerance: float = 1e-7
    # Typical values that scale the interpolation errors of stiffness, mass and velocity
    typical_stroke_m: float = 0.05
    typical_acceleration_m_s2: float = 50.0
    low_speed_m_s: float = 0.01
    curve_error: float = 1e-4  # absolute tolerance of a hysteretic state, whose range is -1 to 1
    speed_error: float = 1e-5  # absolute error of a function of speed; [m/s] for the viscous one, else [-]
    cell_bits_max: int = 6

    # Settings of targets that fit a damper of any size
    force_percentiles: tuple[float, float] = (2.5, 97.5)  # used as min and max of a force with short peaks
    sizing_temperature_degC: float = 20.0
    motion_ratio_max: float = 0.8  # stroke and speed of a motion / stroke and speed of the fitted runs

    # A target is feasible if its distance from the smallest and from the largest possible force is at least
    # margin_N.
    margin_N: float = 20.0
    margin_ratio_max: float = 0.025  # upper limit of margin_N, divided by the peak of the target


SETTINGS = ControlSettings()
