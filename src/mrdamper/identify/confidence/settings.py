"""Settings of the force band, of the standard errors and of the proposed tests."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceSettings:
    """Thresholds that decide how uncertain a fit is reported to be.

    The values of the band were chosen on one family of measured runs and on the virtual dampers with even
    seeds. The table in ``docs/believe.md`` shows the coverage on other runs.

    Parameters
    ----------
    refit_steps : Levenberg-Marquardt steps of a refit without a fold; four steps change the band by 2 %
    band_coverage : fraction of the samples inside the band
    band_run_ratio : half width where the force passes zero, divided by the rms force of the run
    band_base_ratio : half width in a run with a small force, divided by the median rms force of all runs
    band_spread : standard deviations over the folds that are added to the mean of their quantiles
    band_widening : relative widening for each e-fold of additional distance from the fitted motions
    correlation_min : correlations of a larger magnitude are reported
    correlations_max_count : number of correlations reported by name
    energy_error_max : relative error of the energy per cycle above which a run is reported
    """

    refit_steps: int = 2
    band_coverage: float = 0.9
    band_run_ratio: float = 0.15
    band_base_ratio: float = 0.1
    band_spread: float = 0.4
    band_widening: float = 1.5
    correlation_min: float = 0.95
    correlations_max_count: int = 4
    energy_error_max: float = 0.15


DEFAULT_SETTINGS = ConfidenceSettings()
