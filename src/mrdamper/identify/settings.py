"""Settings of a fit: thresholds and limits that decide its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Method = Literal["varpro", "genetic"]
"""Variable projection, or the genetic algorithm of the paper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Limits of the search for parameters, and how runs are cut into windows.

    A *point* is a random point or a start value. A *descent* is a Levenberg-Marquardt search from a point.
    """

    method: Method = "varpro"
    genetic_seed: int = 0  # seed of the random numbers of the genetic algorithm

    # Samples
    rate_Hz: float = 200.0  # sampling rate in a fit; runs with a lower rate keep their rate
    samples_per_period: float = 200.0  # limit for slow motions

    # Windows. A warm-up of one period leaves a force error of 0.02 % (median) and 1 % (worst) of the spread.
    window_periods: float = 1.0  # scored length, in periods of the motion
    warm_up_periods: float = 1.0  # simulated length before a window that is not scored
    window_samples_min: int = 32  # scored length of a window, and of its warm-up, if periods are shorter
    # The kernel evaluates windows with changing current one by one. More samples are replaced by a subset.
    changing_samples_max: int = 5_000
    windows_error_ratio_max: float = 1.2  # error on all data / on the subset; above this, all data are fitted
    temperature_change_K_max: float = 1.0  # A window is divided if the temperature changes more.

    # Differences of two windows that count as distance 1
    size_ratio: float = 1.3  # ratio of amplitudes or speeds
    position_step: float = 0.2  # change of the mean position, relative to the stroke
    current_step: float = 0.1  # relative to the largest current
    temperature_step_K: float = 10.0
    time_step: float = 1.0  # relative to the length of the run

    # Starts, on few windows
    random_start_count: int = 3  # starts of a law without archetypes, each with several points
    screening_samples_max: int = 5_000  # simulated samples of the windows
    draws_per_parameter: int = 8  # points of each start, per searched parameter
    draw_count_max: int = 80  # points of each start
    screened_count: int = 6  # points with the smallest costs that descend
    screening_iterations_max: int = 10
    finalist_count: int = 3  # best results of these descents, from which the full search continues
    finalist_iterations_max: int = 20

    # Thorough search for the chosen candidate
    thorough_count: int = 8  # points that descend
    thorough_iterations_max: int = 20
    hop_iterations_max: int = 20  # iterations after an exchange or a perturbation
    failed_hop_count_max: int = 3  # rounds without a smaller cost that end the search

    # Final fit to all runs
    start_count: int = 4  # parameter sets with the smallest costs that descend
    start_iterations_max: int = 40  # limit of each descent; the best descent continues until it converges
    iterations_max: int = 400  # A fit with more iterations has not converged.
    same_cost_ratio: float = 1e-3  # Parameter sets with a smaller relative difference of costs count as one.


DEFAULT_SETTINGS = FitSettings()
