"""Settings of a fit: thresholds and limits that affect the result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Method = Literal["varpro", "genetic"]
"""Search method: variable projection (``varpro``), or the genetic algorithm of the reference paper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Settings of the parameter search, and of the windows into which runs are cut.

    A *point* is a parameter set, random or given. A *descent* is a Levenberg-Marquardt search from a point.
    """

    method: Method = "varpro"
    genetic_seed: int = 0  # seed of the random numbers of the genetic algorithm

    # Sampling of the runs. Runs are resampled as far as at least the following values remain.
    rate_Hz: float = 200.0  # sampling rate of a fast motion
    samples_per_period: float = 180.0  # number of samples per period of a slow motion

    # Windows (sections of runs) have the length of one period of the motion. Each window begins with an
    # unknown hysteresis state. After an unscored warm-up of one period, the resulting force error is 0.02 %
    # (median run) or 1 % (worst run) of the standard deviation.
    window_samples_min: int = 32  # min length of a window, and also of the warm-up, in samples
    # The kernel evaluates windows with changing current one by one. If the number of samples with changing
    # current exceeds this limit, the fit uses a subset of the data.
    changing_samples_max: int = 5_000
    # All data are fitted if the error on all data exceeds this multiple of the error on the subset.
    windows_error_ratio_max: float = 1.2
    temperature_change_K_max: float = 1.0  # A window with a larger temperature change is divided.

    # Windows are selected by their distance from each other. Two windows have distance 1 if one of the
    # following quantities differs by the stated amount, or the time by the length of the run.
    size_ratio: float = 1.3  # ratio of amplitudes or speeds
    position_step: float = 0.2  # difference of the mean positions, divided by the stroke
    current_step: float = 0.1  # difference of the mean currents, divided by the largest current
    temperature_step_K: float = 10.0

    # Search for initial values of the parameters. The search uses only few windows of the runs.
    random_start_count: int = 3  # number of sets of random points, for laws without a table of start values
    screening_samples_max: int = 5_000  # max number of simulated samples in the selected windows
    draws_per_parameter: int = 8  # number of points in each random set, per nonlinear parameter
    draw_count_max: int = 80  # max number of points in each random set
    screened_count: int = 6  # number of descents, which start at the points with the smallest costs
    screening_iterations_max: int = 10
    finalist_count: int = 3  # number of best descents that are continued
    finalist_iterations_max: int = 20

    # Thorough search: look for further minima of the cost of the chosen law and terms
    thorough_count: int = 8  # number of descents from random points
    thorough_iterations_max: int = 20
    # Max iterations of a descent from a minimum that was perturbed or combined with a second minimum
    hop_iterations_max: int = 20
    failed_hop_count_max: int = 3  # The search ends after this number of rounds that do not reduce the cost.
    minimum_count: int = 12  # number of best minima that are then refined by descents on all windows

    # Final fit to all runs
    start_count: int = 4  # number of descents, which start at the parameter sets with the smallest costs
    start_iterations_max: int = 12  # limit of each descent; the best descent continues until it converges
    iterations_max: int = 400  # A fit with more iterations has not converged.
    same_cost_ratio: float = 1e-3  # Parameter sets with a smaller relative cost difference count as equal.


DEFAULT_SETTINGS = FitSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class NumericalSettings:
    """Tolerances, grids and steps of the numerical methods of the identification."""

    # Two runs have the same operating point if they differ by less than these values.
    same_motion_ratio: float = 1.1  # larger / smaller standard deviation, for displacement and for velocity
    same_current_ratio: float = 0.03  # difference of currents / largest current of all runs
    same_temperature_K: float = 5.0

    # Windows (sections of runs): limits for cutting and joining, simulation effort, and folds
    same_weight_tolerance: float = 1e-6  # relative difference of two weights that count as equal
    steps_per_period_min: int = 380  # min number of integration steps per period, for slow motions
    parallel_window_count: int = 8  # number of windows that the kernel integrates in parallel
    fold_count_max: int = 5
    fold_motion_ratio: float = 1.3  # like ``same_motion_ratio``, for the motions that folds hold out
    # Limits in the fit of delay and lags. Long runs are resampled, but not below 200 Hz, which is necessary
    # to resolve time constants of 5 ms.
    actuation_samples_max: int = 100_000
    actuation_rate_min_Hz: float = 200.0
    acceleration_quantile: float = 1e-3  # This fraction of extreme accelerations is ignored as an artefact.

    # Search: steps of a descent
    step_max_e_folds: float = 1.5  # longest step of a coordinate on a logarithmic scale
    step_range_ratio_max: float = 0.3  # longest step on a linear scale, divided by the range of the bounds
    box_round_count_max: int = 8
    damping_start: float = 1e-2
    damping_max: float = 1e12
    # Drift: relative change of the force if the best linear parameters replace the predicted ones
    drift_max: float = 0.03  # If the drift is larger, the tangents are computed again.
    failed_drift_max: float = 1e-4  # The limit of the drift is stricter after a failed step.
    # A descent has converged if a relative decrease of the cost is smaller than one of the two limits.
    predicted_gain_min: float = 1e-9  # limit for the predicted decrease in the next step
    gain_min: float = 5e-5  # limit for the decrease in the last ``gain_step_count`` steps
    gain_step_count: int = 10
    round_cost_ratio_max: float = 2.0  # Descents with a larger cost / smallest cost are not continued.

    # Search: linear parameters
    # A parameter whose value is at a bound adds this cost [%^2]. Parameters without effect thus stay near 0.
    regularisation_cost: float = 1e-6
    eigenvalue_min: float = 1e-12  # added to the unit diagonal of a scaled matrix before its inversion
    # Relative regularisation of the dual problem. The problem is nearly singular because the conditions at
    # neighbouring currents are nearly equal.
    multiplier_regularisation: float = 1e-10
    # If the elimination reduces the cost below this fraction, rounding errors dominate the cost.
    resolved_cost_ratio: float = 1e-9
    active_stiffness: float = 1e8  # relative stiffness of the penalty that keeps a coefficient at its limit
    invalid_cost: float = 1e6  # cost of a candidate whose coefficients are invalid in all runs [%^2]

    # Thorough search
    # Each perturbation is a pair: the fraction of the coordinates that are changed, and the standard
    # deviation of the change. The unit is an e-fold for coordinates on a logarithmic scale.
    perturbations: tuple[tuple[float, float], ...] = ((1.0, 0.1), (0.5, 0.5), (0.2, 1.5), (0.5, 1.5))
    perturbation_range_ratio: float = 0.1  # unit on a linear scale / range between the bounds
    # Fractions of the coefficients that are replaced by values from a different minimum
    exchanged_fractions: tuple[float, ...] = (0.15, 0.3, 0.5)
    python_law_draw_count: int = 8  # points in each random set for a slow law in Python

    # Conditions and limits of coefficients
    condition_command_count: int = 17  # commands at which conditions are enforced
    condition_temperature_count: int = 3
    limit_command_count: int = 1001  # currents at which the coefficients of a fitted damper are checked
    reported_change_min: float = 1e-3  # A larger relative change by limiting a coefficient is reported.
    bisection_count: int = 40
    # Max relative change of the valve force between centre and end of the stroke. 1 would reverse the force.
    position_change_max: float = 0.99

    # Temperature dependence. A relative decrease below 1 keeps a linear factor positive in the runs.
    linear_decrease_max: float = 0.95
    temperature_margin_K: float = 5.0  # Coefficients are valid this far beyond the temperatures of the runs.
    sharpness_level_count_min: int = 5  # min number of currents for fitting the sharpness of a saturation

    # Delay and lags between command and force
    command_step_ratio: float = 0.01  # step of a difference quotient, divided by the largest command
    parameter_step_ratio: float = 0.01  # step of a difference quotient, divided by the scale of the parameter


NUMERICS = NumericalSettings()
