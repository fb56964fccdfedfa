"""Settings of the force band (expected force error), the standard errors and the proposed tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceSettings:
    """Settings of the reported uncertainty of a fit.

    The settings of the force band were tuned on one family of measured runs and on the virtual dampers with
    even seeds. The table in ``docs/uncertainty.md`` shows the coverage on other runs.
    """

    refit_steps: int = 2  # search steps of each refit in a cross-validation; 4 steps change the band by 2 %
    band_coverage: float = 0.9  # fraction of the samples inside the band
    # The following two ratios define the shape of the force band before its width is scaled.
    band_run_ratio: float = 0.15  # half width at zero force, divided by the rms force of the run
    band_base_ratio: float = 0.1  # half width for very small forces, divided by the median rms force of runs
    band_spread: float = 0.4  # The band is wider than the mean over folds by this many standard deviations.
    # Relative increase of the width for a motion that differs from all fitted motions by a further
    # factor e in size or speed.
    band_widening: float = 1.5
    correlation_min: float = 0.95  # Correlations of a larger magnitude are reported.
    correlations_max_count: int = 4  # max number of correlations that are reported with parameter names
    energy_error_max: float = 0.15  # relative error of the energy per cycle above which a run is reported
    batch_sample_count: int = 4096  # samples of the posterior that are tested at once
    batch_count_max: int = 500  # An error is raised if this number of batches has too few valid samples.

    # Sines that are candidates for proposed tests
    proposal_amplitude_ratios: tuple[float, ...] = (1.0, 0.5, 0.2)  # amplitude divided by half the stroke
    proposal_frequency_count: int = 3
    proposal_command_count: int = 3
    proposal_period_count: int = 2
    proposal_samples_per_period: int = 200
    proposal_velocity_ratio_min: float = 0.03  # peak velocity / maximum velocity of the runs
    prior_information_ratio: float = 1e-7  # added to the unit diagonal of the scaled information matrix


SETTINGS = ConfidenceSettings()
