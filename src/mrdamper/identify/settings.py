"""Settings of a fit: thresholds and limits that affect the result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Method = Literal["varpro", "genetic"]
"""Search method: variable projection (``varpro``), or the genetic algorithm of the paper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """Settings of the parameter search, and of the windows into which runs are cut.

    A *point* is a parameter set, random or given. A *descent* is a Levenberg-Marquardt search from a point.
    """

    method: Method = "varpro"
    genetic_seed: int = 0  # seed of the random numbers of the genetic algorithm

    # Samples
    rate_Hz: float = 200.0  # max sampling rate in a fit; runs with a lower rate keep their rate
    samples_per_period: float = 200.0  # max number of samples per period, which reduces the rate of slow runs

    # Windows. A warm-up of one period leaves a force error of 0.02 % (median) and 1 % (worst) of the spread.
    window_periods: float = 1.0  # scored length of a window, in periods of the motion
    warm_up_periods: float = 1.0  # simulated but not scored length before a window, in periods
    window_samples_min: int = 32  # min length of a window, and of its warm-up, in samples
    # The kernel evaluates windows with changing current one by one. If there are more samples with changing
    # current than this, the fit uses a subset of the data.
    changing_samples_max: int = 5_000
    # All data are fitted if the error on all data exceeds this multiple of the error on the subset.
    windows_error_ratio_max: float = 1.2
    temperature_change_K_max: float = 1.0  # A window with a larger temperature change is divided.

    # Differences of two windows that count as distance 1
    size_ratio: float = 1.3  # ratio of amplitudes or speeds
    position_step: float = 0.2  # difference of the mean positions, divided by the stroke
    current_step: float = 0.1  # difference of the currents, divided by the largest current
    temperature_step_K: float = 10.0
    time_step: float = 1.0  # difference of the times, divided by the length of the run

    # Search for start values, on few windows
    random_start_count: int = 3  # starts of a law that has no archetypes; each start has many points
    screening_samples_max: int = 5_000  # max number of simulated samples of the windows
    draws_per_parameter: int = 8  # random points of each start, per searched parameter
    draw_count_max: int = 80  # max number of random points of each start
    screened_count: int = 6  # number of descents, which start at the points with the smallest costs
    screening_iterations_max: int = 10
    finalist_count: int = 3  # number of best descents that the full search continues
    finalist_iterations_max: int = 20

    # Thorough search for the chosen candidate
    thorough_count: int = 8  # number of descents
    thorough_iterations_max: int = 20
    # Iterations after coefficients of two parameter sets are exchanged or a parameter set is perturbed.
    hop_iterations_max: int = 20
    failed_hop_count_max: int = 3  # The search ends after this number of rounds that do not reduce the cost.

    # Final fit to all runs
    start_count: int = 4  # number of descents, which start at the parameter sets with the smallest costs
    start_iterations_max: int = 40  # limit of each descent; the best descent continues until it converges
    iterations_max: int = 400  # A fit with more iterations has not converged.
    same_cost_ratio: float = 1e-3  # Parameter sets with a smaller relative difference of costs are equal.


DEFAULT_SETTINGS = FitSettings()
