"""Settings of the thermal simulation: thresholds, grids and weights that affect results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalSettings:
    """Settings of the load cycles, the compact model, the calibration and the design of fins."""

    # Geometry and materials
    coil_depth_ratio: float = 0.4  # default depth of the coil / radial distance from rod to piston surface
    carrier_conductivity_W_mK: float = 0.14  # default conductivity of the carrier oil
    mixed_fraction: float = 0.5  # fraction of the displaced fluid that mixes in a chamber before returning

    # Load cycles and their power
    motion_time_s: float = 120.0  # simulated time of a non-periodic motion, for the mean power
    measured_motion_time_s: float = 20.0  # duration of each segment into which a measured motion is divided
    step_deviation_ratio_max: float = 1e-3  # max deviation of a time step from the mean step / mean step
    duration_max_s: float = 1e6  # max duration of a load cycle
    # Range of the temperatures at which force loops are simulated, within the range of the model card
    loss_temperature_range_K: tuple[float, float] = (273.15, 423.15)
    loss_temperature_count: int = 11
    # A higher pressure on the piston indicates that model card and geometry are from different dampers.
    piston_pressure_max_Pa: float = 50e6

    # Derating: table of the permissible load
    map_model_order: int = 24  # number of unknowns of the reduced thermal model
    map_steady_time_s: float = 4.0 * 3600.0  # time of the 90 % interval that is used for the steady state
    map_step_max_s: float = 120.0
    map_first_step_s: float = 5.0

    # Breakpoints of the convection table of the compact model; a rise is surface minus ambient temperature
    film_ambient_K: tuple[float, ...] = (253.15, 288.15, 323.15)  # three equidistant values
    film_air_speeds_m_s: tuple[float, ...] = (0.0, 0.25, 0.4, 0.6, 0.9, 1.35, 2.0, 3.0, 4.5, 6.5, 9.0, 12.0)
    film_rises_K: tuple[float, ...] = (-20.0, -5.0, 0.0, 3.0, 8.0, 15.0, 25.0, 40.0, 60.0, 85.0, 115.0, 150.0)

    # Compact thermal model for a controller
    compact_state_count: int = 6
    source_model_order: int = 40  # unknowns of the reduced model from which the compact model is computed
    basis_air_speeds_m_s: tuple[float, ...] = (0.0, 3.0)  # air speeds for which the modes are computed
    typical_rise_K: float = 60.0  # rise above ambient at which heat transfer is linearised
    # The hottest points of temperature fields that grow exponentially at these rates are selected.
    spot_rates_1_s: tuple[float, ...] = (0.0, 3e-3, 3e-2)
    # Weights of the inputs and outputs in the Gramian
    mechanical_weight_W: float = 100.0
    coil_weight_W: float = 20.0
    surface_weight_W: float = 20.0
    output_weight_W: float = 100.0

    # Kalman filter of the compact model
    # The typical power would heat the damper by typical_power_rise_K in typical_power_time_s without losses.
    typical_power_rise_K: float = 100.0
    typical_power_time_s: float = 1800.0
    # Standard deviations of power error and missing heat / typical power, and their correlation times
    power_error_ratio: float = 0.15
    power_error_time_s: float = 60.0
    missing_heat_ratio: float = 0.15
    missing_heat_time_s: float = 1800.0
    # Standard deviations of the readings of fluid and coil, and their correlation time
    fluid_noise_K: float = 0.5
    coil_noise_K: float = 3.0
    sensor_noise_time_s: float = 10.0

    # Measured heating curve
    readings_min: int = 8
    bad_readings_ratio_max: float = 0.2  # A larger fraction of bad readings indicates a broken sensor.
    # A spike deviates from the samples before and after the spike by more than these three limits.
    spike_deviations_min: float = 8.0  # multiple of the noise
    spike_min_K: float = 0.5
    spike_ranges_min: float = 4.0  # multiple of the range of the neighbouring samples
    spike_neighbours: tuple[int, ...] = (-3, -2, -1, 1, 2, 3)  # positions relative to the spike

    # Calibration with a heating curve
    calibration_step_max_s: float = 20.0  # max time step of the simulations
    # If a factor reaches a bound of this range, the heating curve does not belong to the load cycle.
    calibration_factor_range: tuple[float, float] = (0.05, 20.0)
    start_range_K: float = 50.0  # max distance of the initial temperature from the first readings
    reading_noise_min_K: float = 0.02  # A smaller estimated noise is replaced by this value.
    reading_noise_max_K: float = 2.0
    residual_ratio_max: float = 0.03  # max residual / temperature range of the curve
    neighbour_correlation_max: float = 0.999  # upper limit of the correlation of adjacent residuals
    reference_excess_K: float = 40.0  # rise at which heat losses are compared with the uncalibrated geometry
    trial_margin_K: float = 100.0  # A simulation stops this far below the highest tabulated temperature.

    # Interval of a predicted heating curve
    interval_deviations: float = 1.645  # half width of a normal 90 % interval / standard deviation
    stop_excess_K: float = 50.0  # A simulation stops this far above the limits and above the predicted curve.
    run_margin_K: float = 20.0  # A simulation stops this far below the highest tabulated temperature.
    misfit_ratio: float = 0.004  # standard deviation of the error of a calibrated network / temperature rise

    # Design of fins
    sink_step_max_s: float = 120.0  # max time step; its error is 10 mK after half an hour for all heat sinks
    sink_width_ratios: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)  # evaluated fin width / largest width
    fin_thickness_ratios: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)  # evaluated thickness / smallest one
    sink_span_ratios: tuple[float, ...] = (0.6, 1.0)  # evaluated fin pitch / largest pitch
    sink_grid_m: float = 1e-4  # Pitches and widths are whole tenths of a millimetre.
    fin_gap_max_widths: float = 2.0  # max gap between two fins / radial width of the fins
    # Half widths of 90 % intervals
    gap_exponent_error: float = 0.12  # error of n, if the coefficient of fins is proportional to gap^n
    body_film_error: float = 0.15  # relative error of the heat-transfer coefficient of the body
    sink_power_error: float = 0.165  # relative error of the mechanical power: 1.645 times 10 %


SETTINGS = ThermalSettings()
