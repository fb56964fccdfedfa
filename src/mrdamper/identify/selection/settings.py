"""Settings of the model selection: thresholds that decide which law and terms are chosen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionSettings:
    """Limits and thresholds of the model selection.

    The error of a run is the root-mean-square error in percent of the standard deviation of the force. The
    training error of a candidate is the root mean square over the runs, because a fit minimises it. The
    cross-validation error is the mean over the runs. A *ratio* divides an error by the smallest error of the
    same kind. A *gain* is a relative decrease of an error: 0.01 means 1 %.
    """

    # Data: the selection is repeated with more windows if the error of the chosen candidate on all runs is
    # larger than this ratio times its error on the windows.
    samples_max: int = 15_000  # simulated samples of the windows
    screening_fraction: float = 1.0 / 3.0  # samples of the screening windows, relative to these, at most
    subset_error_ratio_max: float = 1.2
    subset_growth: float = 3.0  # factor of the samples in such a repetition

    # Screening. Modular laws are always kept, because their first candidates have few terms.
    start_error_ratio_max: float = 2.0  # error of the best start divided by the error of the first law's fit
    training_error_ratio_max: float = 1.5  # training error of another law divided by the smallest one
    finalist_count_max: int = 3  # other laws that are cross-validated

    # Forward selection
    archetype_error_ratio_max: float = 1.2  # training errors of the archetypes that are cross-validated
    law_cv_ratio_max: float = 1.2  # Above this ratio, a law gets no terms unless the law is modular.
    round_count_max: int = 8  # rounds of adding terms to a law
    term_count_max: int = 3  # terms that are fitted in each round
    # A smaller gain in training error is unlikely to be significant in cross-validation.
    training_gain_min: float = 0.003
    # A second term of the same round needs this fraction of the training gain of the accepted term.
    training_gain_fraction_min: float = 0.25

    # Comparison of two candidates: one is better if its cross-validation gain and the gain's Student's t over
    # the folds exceed these values. A smaller gain with a larger t is also sufficient.
    cv_gain_min: float = 0.01
    cv_gain_t_min: float = 1.0
    small_cv_gain_min: float = 0.003
    small_cv_gain_t_min: float = 2.0

    # Backward elimination
    removal_loss_max: float = 0.003  # increase of the cross-validation error
    removal_screening_loss_max: float = 0.01  # increase of the error on the screening windows

    # Thorough search
    # Number of candidates that are searched. After a search, another candidate can be the best one.
    improvement_count_max: int = 2

    # Fits of one candidate
    fit_iterations: int = 8  # iterations of one round
    fit_round_count_max: int = 6
    round_gain_min: float = 0.004  # gain in error of a round that is required for another one
    fold_iterations: int = 4  # A fit without one fold starts from the fit to all windows.
    screening_iterations: int = 8  # iterations of a fit with one additional term
    gas_error_percent_min: float = 2.0  # Larger effect of temperature on mean forces: start with gas force.
    asymmetry_error_percent_min: float = 5.0  # Larger effect of force on mean forces: start asymmetric.

    # Response to the current
    changing_run_count_max: int = 4
    changing_samples_max: int = 3000  # target samples of each run; the rate limits below have priority
    changing_rate_Hz_min: float = 50.0
    changing_rate_Hz_max: float = 200.0
    changing_tolerance: float = 1e-2  # relative change that ends the fit of the actuation
    changing_share_step_min: float = 0.25  # step of the force fraction that follows the command at once


DEFAULT_SETTINGS = SelectionSettings()
