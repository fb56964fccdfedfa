"""Settings of a fit: thresholds and limits that decide its result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Limits of the search for parameters, and how runs are cut into windows.

    Parameters
    ----------
    rate_Hz : sampling rate inside a fit; slower runs keep their own rate
    samples_per_period : slow motions are sampled at this number of samples per period
    window_periods : scored length of a window, in periods of the motion
    warm_up_periods : simulated and not scored length before a window, in periods. One period leaves a force
        error of 0.02 % (median) and 1 % (worst) of the standard deviation of the force
    window_samples_min : scored length of a window, and of its warm-up, if periods are shorter
    size_ratio : ratio of amplitudes or of speeds of two windows that counts as distance 1
    position_step : difference of mean position that counts as distance 1, relative to the stroke
    current_step : difference of current that counts as distance 1, relative to the largest current
    temperature_step_K : difference of temperature that counts as distance 1
    time_step : difference of time that counts as distance 1, relative to the length of the run
    temperature_change_K_max : a window uses its mean temperature; it is divided if its temperature changes
        more
    random_start_count : random starts of a law without archetypes
    screening_samples_max : simulated samples of the windows on which starts are compared
    draws_per_parameter, draw_count_max : random points of each start, per searched parameter and at most
    screened_count : points with the smallest costs that descend on the screening windows
    screening_iterations_max : iterations of these descents
    finalist_count : ends of these descents that go on
    finalist_iterations_max : further iterations on the screening windows
    thorough_count, thorough_iterations_max : the same for the chosen candidate: points that descend,
        iterations
    hop_iterations_max : iterations after a perturbation of the best end of these descents
    failed_hop_count_max : perturbations without a smaller cost that end the search
    start_count : different parameter sets with the smallest costs on all runs that descend on all runs
    start_iterations_max : iterations of each; the best one goes on until it converges
    iterations_max : iterations after which a fit counts as not converged
    same_cost_ratio : relative difference of costs below which two parameter sets count as one
    """

    rate_Hz: float = 200.0
    samples_per_period: float = 200.0

    window_periods: float = 1.0
    warm_up_periods: float = 1.0
    window_samples_min: int = 64
    size_ratio: float = 1.3
    position_step: float = 0.2
    current_step: float = 0.1
    temperature_step_K: float = 10.0
    time_step: float = 1.0
    temperature_change_K_max: float = 1.0

    random_start_count: int = 3
    screening_samples_max: int = 5_000
    draws_per_parameter: int = 8
    draw_count_max: int = 80
    screened_count: int = 6
    screening_iterations_max: int = 10
    finalist_count: int = 3
    finalist_iterations_max: int = 20
    thorough_count: int = 8
    thorough_iterations_max: int = 20
    hop_iterations_max: int = 20
    failed_hop_count_max: int = 5
    start_count: int = 4
    start_iterations_max: int = 40
    iterations_max: int = 400
    same_cost_ratio: float = 1e-3


DEFAULT_SETTINGS = FitSettings()
