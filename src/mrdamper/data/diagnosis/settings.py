"""Thresholds of the diagnosis: they decide which findings a run or a campaign gets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisSettings:
    """Thresholds of the findings. In comments, ``a / b`` is the ratio of a to b."""

    # Copies of a run
    copy_rounding_ratio_max: float = 1e-4  # difference by rounding in a file conversion / range
    copy_stroke_ratio_max: float = 0.02  # difference of the displacements of two copies / stroke
    copy_noise_ratio_max: float = 0.7  # difference of two copies / white noise; separate recordings: 1.4
    copy_sample_count: int = 64  # samples of each run that are compared in the search for copies

    # Two dampers, or a delay between force and displacement
    same_motion_ratio_max: float = 0.03  # relative difference of strokes and of half periods of equal motions
    same_damper_force_ratio_max: float = 0.15  # relative difference of force ranges at equal conditions
    same_temperature_tolerance_K: float = 3.0
    reversal_stroke_ratio_min: float = 0.2  # motion after a reversal / stroke
    reversal_fit_sample_count: int = 4  # samples on each side of a reversal that determine its time
    half_cycle_ratio_max: float = 0.2  # relative difference of the half-cycle durations of a periodic motion
    force_delay_max_s: float = 0.010
    force_delay_min_s: float = -0.002  # negative: the force leads
    frequency_ratio_min: float = 1.3  # min ratio of frequencies to distinguish a delay from compliance

    # Runs that differ from their name or from runs of the same motion
    period_ratio_max: float = 0.03  # range of the periods of a sine / median period
    sibling_run_count_min: int = 3  # min number of other runs with the same motion

    # Offset, drift and delay of one run
    force_offset_ratio_max: float = 0.05  # mean force / standard deviation of the force
    drift_ratio_max: float = 0.03  # fraction of the stroke and of the force range
    force_range_change_max_percent: float = 5.0  # change between the first and the last cycle
    force_lead_max_periods: float = 0.003  # The force may lead the velocity by this fraction of the period.
    force_lag_max_periods: float = 0.17  # The force may lag the velocity by this fraction (60 degrees).

    # Ranges of published dampers; ``find_implausible_damper`` names the sources
    peak_force_range_N: tuple[float, float] = (150.0, 20e3)
    peak_force_min_at_1A_N: float = 300.0
    peak_current_range_A: tuple[float, float] = (0.3, 15.0)
    stroke_range_m: tuple[float, float] = (2e-3, 0.5)

    # Comparison of the cycles of one run
    cycle_ratio_max: float = 0.03  # deviation of stroke, duration or end position from the typical cycle
    cycle_phase_count: int = 200  # points at which cycles are compared

    # Samples, noise and interference
    cycle_samples_min: float = 60.0  # A run with fewer samples in its fastest cycle gets a warning.
    cycle_samples_fault_max: float = 20.0  # A run with at most this number of samples has a fault.
    fast_reversal_stroke_ratio_min: float = 0.3  # motion after a reversal / range of displacement
    force_noise_max_percent: float = 5.0  # white noise / standard deviation of the force
    cycle_deviation_max_percent: float = 5.0  # deviation from mean cycle / standard deviation of force
    line_force_ratio_min: float = 0.03  # rms of a spectral line / standard deviation of the force
    line_power_ratio_min: float = 0.5  # power of the line / power of the deviation from the mean cycle
    # Min distance of a spectral line from a harmonic of the motion, in bins of the spectrum. In multiples of
    # the motion's frequency, this distance is limited to ``line_distance_range_harmonics``.
    line_distance_min_bins: float = 1.2
    line_distance_range_harmonics: tuple[float, float] = (0.1, 0.3)
    line_cycle_count_min: int = 3
    line_harmonic_min: float = 2.0  # Slow changes of the force are below this harmonic.

    # Clipped channels
    clipped_segment_samples_min: int = 3  # consecutive samples at the extreme value
    clipped_count_ratio_min: float = 8.0  # samples at the extreme value / mean number at the next values
    clipped_level_count: int = 4  # number of values next to the extreme value for this comparison
    clipped_samples_min: int = 8  # samples at the extreme value
    clipped_ratio_max: float = 0.01  # A larger fraction of clipped samples is a fault.

    # Coarse, stuck or disturbed channels
    coarse_note_ratio: float = 0.01  # rounding error / standard deviation; a larger ratio gives a note
    coarse_warning_ratio: float = 0.03  # rounding error / standard deviation; a larger ratio gives a warning
    quantised_ratio_min: float = 0.8  # Quantised: this fraction of differences is whole steps.
    stuck_steps_min: int = 20  # time steps with a constant value
    stuck_motion_ratio_min: float = 0.15  # change of the displacement / its range, while the force is stuck
    stuck_level_max_steps: float = 1.5  # change before and after a slow, constant segment / resolution
    spike_height_ratio_min: float = 0.1  # height of a spike / range from 0.5 % to 99.5 % quantile
    spike_noise_ratio_min: float = 30.0  # height of a spike / white noise
    spike_samples_min: int = 100  # min number of samples in a run, and min number for each spike

    # Lost samples and jumps of the displacement
    lost_step_ratio_min: float = 1.5  # time step / median time step
    jump_slope_ratio_min: float = 0.6  # jump / rms slope of the displacement
    jump_noise_ratio_min: float = 10.0  # jump / typical difference between neighbouring slopes
    jump_samples_min: int = 64  # Shorter runs have too few neighbouring steps.


SETTINGS = DiagnosisSettings()
