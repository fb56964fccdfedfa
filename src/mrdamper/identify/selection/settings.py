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

    # Data
    samples_max: int = 15_000  # max number of simulated samples of the windows
    screening_fraction: float = 1.0 / 3.0  # max samples of the screening windows, divided by samples_max
    # The selection is repeated with more windows if the error of the chosen candidate on all runs exceeds
    # this multiple of its error on the windows.
    subset_error_ratio_max: float = 1.2
    subset_growth: float = 3.0  # increase factor of samples_max in a repetition

    # Screening. Modular laws are always kept, because their first candidates have few terms.
    start_error_ratio_max: float = 2.0  # error of the best start, divided by the fit error of the first law
    training_error_ratio_max: float = 1.5  # training error of a law, divided by the smallest training error
    finalist_count_max: int = 3  # max number of laws that are cross-validated, modular laws not counted

    # Forward selection
    # Archetypes with a larger ratio of training errors are not cross-validated.
    archetype_error_ratio_max: float = 1.2
    # A law with a larger ratio of cross-validation errors gets no terms unless the law is modular.
    law_cv_ratio_max: float = 1.2
    round_count_max: int = 8  # max number of rounds of adding terms to a law
    term_count_max: int = 3  # max number of terms that are fitted in each round
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
    removal_loss_max: float = 0.003  # max relative increase of the cross-validation error
    removal_screening_loss_max: float = 0.01  # max relative increase of the error on the screening windows

    # Thorough search
    # Max number of candidates that are searched. After a search, another candidate can be the best one.
    improvement_count_max: int = 2

    # Fits of one candidate
    fit_iterations: int = 8  # iterations of one round
    fit_round_count_max: int = 6
    round_gain_min: float = 0.004  # The next round starts only if the gain of a round exceeds this value.
    fold_iterations: int = 4  # iterations of a fit without one fold, from the fit to all windows
    screening_iterations: int = 8  # iterations of a fit with one additional term
    # The start has a gas force if the temperature changes the mean forces by more than this.
    gas_error_percent_min: float = 2.0
    # The start is also made asymmetric if the size of the force changes the mean forces by more than this.
    asymmetry_error_percent_min: float = 5.0

    # Response to the current
    changing_run_count_max: int = 4  # max number of runs to which the actuation is fitted
    changing_samples_max: int = 3000  # target samples of each run; the rate limits below have priority
    changing_rate_Hz_min: float = 50.0
    changing_rate_Hz_max: float = 200.0
    changing_tolerance: float = 1e-2  # relative change that ends the fit of the actuation
    changing_share_step_min: float = 0.25  # smallest step in the search for ``follow_share``


DEFAULT_SETTINGS = SelectionSettings()
