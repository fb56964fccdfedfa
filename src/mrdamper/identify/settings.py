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

    # Samples
    rate_Hz: float = 200.0  # max sampling rate in a fit; runs with a lower rate are not resampled
    samples_per_period: float = 200.0  # max number of samples per period; limits the rate of slow motions

    # Windows. The force error that remains after a warm-up of one period is 0.02 % (median) or 1 % (worst
    # run), relative to the standard deviation of the force.
    window_periods: float = 1.0  # scored length of a window, in periods of the motion
    warm_up_periods: float = 1.0  # length of the unscored simulation before a window, in periods
    window_samples_min: int = 32  # min length of a window, and also of the warm-up, in samples
    # The kernel evaluates windows with changing current one by one. If there are more samples with changing
    # current than this, the fit uses a subset of the data.
    changing_samples_max: int = 5_000
    # All data are fitted if the error on all data exceeds this multiple of the error on the subset.
    windows_error_ratio_max: float = 1.2
    temperature_change_K_max: float = 1.0  # A window with a larger temperature change is divided.

    # Unit distances for the selection of windows: two windows with one of these differences have distance 1
    size_ratio: float = 1.3  # ratio of amplitudes or speeds
    position_step: float = 0.2  # difference of the mean positions, divided by the stroke
    current_step: float = 0.1  # difference of the mean currents, divided by the largest current
    temperature_step_K: float = 10.0
    time_step: float = 1.0  # difference of the times, divided by the length of the run

    # Search for start values, on few windows
    random_start_count: int = 3  # number of sets of random points for a law without typical start values
    screening_samples_max: int = 5_000  # max number of simulated samples in this search
    draws_per_parameter: int = 8  # number of points in each random set, per nonlinear parameter
    draw_count_max: int = 80  # max number of points in each random set
    screened_count: int = 6  # number of descents, which start at the points with the smallest costs
    screening_iterations_max: int = 10
    finalist_count: int = 3  # number of best descents that the full search continues
    finalist_iterations_max: int = 20

    # Thorough search for the chosen candidate
    thorough_count: int = 8  # number of descents
    thorough_iterations_max: int = 20
    # Max iterations of a descent from a minimum that was perturbed or combined with a second minimum
    hop_iterations_max: int = 20
    failed_hop_count_max: int = 3  # The search ends after this number of rounds that do not reduce the cost.
    minimum_count: int = 6  # number of minima of the search from which descents on all windows start

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
    same_motion_ratio: float = 1.1  # ratio of standard deviations of displacement and of velocity
    same_current_ratio: float = 0.03  # difference of currents / largest current of all runs
    same_temperature_K: float = 5.0

    # Windows
    same_weight_tolerance: float = 1e-6  # relative difference of two weights that count as equal
    steps_per_period_min: int = 400  # integration steps for slow motions
    steps_per_sample: int = 4  # A sample with more integration steps counts as several samples of work.
    parallel_window_count: int = 8  # number of windows that the kernel integrates in parallel
    fold_count_max: int = 5
    # Runs have the same motion if the ratio of their standard deviations (displacement and velocity) is
    # smaller.
    fold_motion_ratio: float = 1.3
    # Limits in the fit of delay and lags. Long runs are resampled, but not below 200 Hz, which is necessary
    # to resolve time constants of 5 ms.
    actuation_samples_max: int = 100_000
    actuation_rate_min_Hz: float = 200.0
    acceleration_quantile: float = 1e-3  # This fraction of extreme accelerations is ignored as an artefact.

    # Search: steps of a descent
    step_max_e_folds: float = 1.5  # longest step of a coordinate on a logarithmic scale
    step_range_ratio_max: float = 0.3  # longest step on a linear scale / range of the bounds
    box_round_count_max: int = 8
    damping_start: float = 1e-2
    damping_max: float = 1e12
    # Drift: relative change of the force if the best linear parameters replace the predicted ones
    drift_max: float = 0.03  # If the drift is larger, the tangents are computed again.
    failed_drift_max: float = 1e-4  # max drift after a failed step, as for drift_max
    # A descent has converged if one of the following two decreases of the cost is smaller than the limit.
    predicted_gain_min: float = 1e-9  # predicted decrease in the next step / cost
    gain_min: float = 5e-5  # decrease in the last ``gain_step_count`` steps / cost
    gain_step_count: int = 10
    round_cost_ratio_max: float = 2.0  # cost / smallest cost of the descents that the next round continues

    # Search: linear parameters
    regularisation_cost: float = 1e-6  # cost [%^2] of a parameter at a bound; unused parameters stay near 0
    eigenvalue_min: float = 1e-12  # regularisation of a matrix with a unit diagonal
    # Relative regularisation of the dual problem: conditions at neighbouring currents are nearly equal
    multiplier_regularisation: float = 1e-10
    resolved_cost_ratio: float = 1e-9  # If cost / cost of the guess is smaller, rounding errors dominate.
    active_stiffness: float = 1e8  # relative penalty that keeps an active condition active
    sum_count_max: int = 1 << 21  # max number of Gram matrix elements of single runs in memory
    # OpenBLAS uses one thread up to this product size. Several threads would waste time in busy waiting.
    one_thread_size_max: int = 1 << 17
    invalid_cost: float = 1e6  # cost of a candidate whose coefficients are invalid in all runs [%^2]

    # Thorough search
    # Perturbations: fraction of the coordinates that are changed, and standard deviation of the change in
    # e-folds for coordinates on a logarithmic scale
    perturbations: tuple[tuple[float, float], ...] = ((1.0, 0.1), (0.5, 0.5), (0.2, 1.5), (0.5, 1.5))
    # A perturbation of 1 e-fold is replaced by this fraction of the range between the bounds if the scale is
    # linear.
    perturbation_range_ratio: float = 0.1
    exchanged_fractions: tuple[float, ...] = (0.15, 0.3, 0.5)  # fraction of coefficients from another minimum
    python_law_draw_count: int = 8  # points in each random set for a slow law in Python

    # Conditions and limits of coefficients
    condition_command_count: int = 17  # commands at which conditions are enforced
    condition_temperature_count: int = 3
    limit_command_count: int = 1001  # currents at which the coefficients of a fitted damper are checked
    reported_change_min: float = 1e-3  # change of a coefficient by its limit, divided by its maximum
    bisection_count: int = 40
    # Relative change of the valve force by the position gain at the end of the stroke; 1 changes the sign
    position_change_max: float = 0.99

    # Temperature
    linear_decrease_max: float = 0.95  # less than 1 keeps a linear factor positive at measured temperatures
    temperature_margin_K: float = 5.0  # Coefficients are valid this far beyond the temperatures of the runs.
    sharpness_level_count_min: int = 5  # min number of currents for fitting the sharpness of a saturation

    # Delay and lags between command and force
    command_step_ratio: float = 0.01  # step of a difference quotient / largest command
    parameter_step_ratio: float = 0.01  # step of a difference quotient / scale of the parameter


NUMERICS = NumericalSettings()
