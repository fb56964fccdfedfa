"""Settings of the heating: thresholds, grids and weights that decide results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalSettings:
    """Settings of the load cycles, the compact network, the calibration and the fin design."""

    # Geometry and materials
    coil_depth_ratio: float = 0.4  # default depth of the coil / depth of the piston around the rod
    carrier_conductivity_W_mK: float = 0.14  # default of the carrier oil
    sink_length_max_mm: float = 10_000.0  # A longer length has probably another unit.
    heat_capacity_coefficients_max: int = 6
    heat_capacity_point_count: int = 101  # temperatures at which a polynomial has to be positive
    mixed_fraction: float = 0.5  # fraction of the displaced volume that mixes before it returns

    # Load cycles and their power
    motion_time_s: float = 120.0  # averaging time of a motion that is not periodic
    measured_motion_time_s: float = 20.0  # averaging time of a measured motion
    step_deviation_ratio_max: float = 1e-3  # deviation of the time steps of a table
    duration_max_s: float = 1e6
    # Loops are simulated where the card covers this range.
    loss_temperature_range_K: tuple[float, float] = (273.15, 423.15)
    loss_temperature_count: int = 11
    piston_pressure_max_Pa: float = 50e6  # Above, card and geometry probably belong to different dampers.

    # Map of the permissible load
    map_model_order: int = 24  # unknowns of the reduced model of the map
    map_steady_time_s: float = 4.0 * 3600.0  # The interval of the steady state is taken after this time.
    map_step_max_s: float = 120.0
    map_first_step_s: float = 5.0

    # Compact model: grid of the heat-transfer coefficients
    compact_state_count: int = 6
    film_ambient_K: tuple[float, ...] = (253.15, 288.15, 323.15)  # knots of the parabola
    film_air_speeds_m_s: tuple[float, ...] = (0.0, 0.25, 0.4, 0.6, 0.9, 1.35, 2.0, 3.0, 4.5, 6.5, 9.0, 12.0)
    # rise of the surface above ambient
    film_rises_K: tuple[float, ...] = (-20.0, -5.0, 0.0, 3.0, 8.0, 15.0, 25.0, 40.0, 60.0, 85.0, 115.0, 150.0)

    # Compact model: reduction
    basis_air_speeds_m_s: tuple[float, ...] = (0.0, 3.0)  # air speeds for which the basis is computed
    source_model_order: int = 40  # order of the reduced model from which the compact model is made
    typical_rise_K: float = 60.0  # rise above ambient of the basis, and of the linearisation for the gains
    spot_rates_1_s: tuple[float, ...] = (
        0.0,
        3e-3,
        3e-2,
    )  # rates of the responses that select the hottest points
    # Weights of the inputs and outputs in the Gramian
    mechanical_weight_W: float = 100.0
    coil_weight_W: float = 20.0
    surface_weight_W: float = 20.0
    output_weight_W: float = 100.0

    # Compact model: Kalman filter
    # The typical power causes this temperature rise in this time, without losses.
    typical_power_rise_K: float = 100.0
    typical_power_time_s: float = 1800.0
    # Standard deviations and correlation times of the relative power error and of the relative missing heat
    power_error_ratio: float = 0.15
    power_error_time_s: float = 60.0
    missing_heat_ratio: float = 0.15
    missing_heat_time_s: float = 1800.0
    # Standard deviations of the fluid and coil readings, and their correlation time
    fluid_noise_K: float = 0.5
    coil_noise_K: float = 3.0
    sensor_noise_time_s: float = 10.0

    # Measured heating curve
    bad_readings_ratio_max: float = 0.2  # More bad readings mean a broken sensor.
    readings_min: int = 8
    spike_deviations_min: float = 8.0  # deviation of a spike / standard deviation of the noise
    spike_min_K: float = 0.5
    spike_ranges_min: float = 4.0  # deviation of a spike / range of its neighbours
    spike_neighbours: tuple[int, ...] = (-3, -2, -1, 1, 2, 3)

    # Calibration by a heating curve
    calibration_step_max_s: float = 20.0
    # A factor outside means that curve and load cycle do not match.
    calibration_factor_range: tuple[float, float] = (0.05, 20.0)
    start_range_K: float = 50.0  # The start is searched within this distance of the first readings.
    reading_noise_min_K: float = 0.02
    reading_noise_max_K: float = 2.0
    residual_ratio_max: float = 0.03  # A larger residual / range indicates the curve of another damper.
    neighbour_correlation_max: float = 0.999
    reference_excess_K: float = 40.0  # Losses are compared at this excess over ambient.
    trial_margin_K: float = 100.0  # A trial stops this far below the end of the tables of losses.

    # Interval of the temperature
    interval_deviations: float = 1.645  # standard deviations of a 90 % interval of a normal distribution
    stop_excess_K: float = 50.0  # Runs end this far above all limits because later values are not needed.
    run_margin_K: float = 20.0
    misfit_ratio: float = 0.004  # remaining error of a calibrated network / rise

    # Fin design
    sink_step_max_s: float = 120.0  # The error of about 10 mK after half an hour is equal for all sinks.
    sink_width_ratios: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)  # fractions of the largest width
    fin_thickness_ratios: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)  # multiples of the smallest thickness
    sink_span_ratios: tuple[float, ...] = (0.6, 1.0)  # fractions of the span
    sink_grid_m: float = 1e-4  # Pitches and widths are whole tenths of a millimetre.
    fin_gap_max_widths: float = 2.0  # For wider gaps the body between two fins is not a groove.
    # Half widths of 90 % intervals, relative except for the exponent
    gap_exponent_error: float = 0.12  # A correlation can be wrong by this power of the ratio of two gaps.
    body_film_error: float = 0.15
    sink_power_error: float = 0.165  # 1.645 standard deviations of 10 %


SETTINGS = ThermalSettings()
