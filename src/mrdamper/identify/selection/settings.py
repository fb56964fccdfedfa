"""Settings of the model selection: thresholds that decide which law and terms are chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

from mrdamper.identify.actuation import ActuationSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionSettings:
    """Limits and thresholds of the model selection.

    The error of a run is the root-mean-square error in percent of the standard deviation of the force. The
    training error of a candidate is the root mean square over the runs, because a fit minimises it. The
    cross-validation error is the mean over the runs. A *ratio* divides an error by the smallest error of the
    same kind. A *gain* is a relative decrease of an error: 0.01 means 1 %. ``select`` defines other words.
    """

    # Amount of data in the fits of the selection
    samples_max: int = 9_000  # max number of simulated samples in all windows (9 s for a fit of 20 runs)
    screening_fraction: float = 1.0 / 3.0  # A quick first fit uses at most this fraction of ``samples_max``.
    search_fraction: float = 0.5  # The thorough search uses at most this fraction of ``samples_max``.
    # The model selection is repeated with more windows if the error of the chosen candidate on all runs
    # exceeds this multiple of its error on the windows.
    subset_error_ratio_max: float = 1.2
    subset_growth: float = 3.0  # Each repetition multiplies ``samples_max`` by this factor.

    # Screening. Modular laws are always kept, because their first candidates have few terms.
    start_error_ratio_max: float = 1.5  # max error after short descents / smallest error of a law
    training_error_ratio_max: float = 1.5  # max training error of a law / smallest training error of a law
    finalist_count_max: int = 3  # max number of cross-validated laws that are not modular

    # Forward selection
    # An archetype is a first set of terms of a law. It is cross-validated only if its training error, divided
    # by the smallest training error of all archetypes of this law, is below this limit.
    archetype_error_ratio_max: float = 1.2
    # Max cross-validation error / smallest error. Above it, a law that is not modular gets no further terms,
    # because they decrease its error by at most 1.5 % (UTFSM and UTFPR runs).
    law_cv_ratio_max: float = 1.02
    round_count_max: int = 8  # max number of rounds of adding terms to a law
    term_count_max: int = 3  # max number of terms that are fitted in each round
    # Candidates with a smaller training gain are not cross-validated, because they are hardly ever chosen.
    training_gain_min: float = 0.003
    # A second term is cross-validated in a round only if its training gain is at least this fraction of the
    # training gain of the first accepted term.
    training_gain_fraction_min: float = 0.25

    # Comparison of two candidates of a law by the cross-validation gain and Student's t of the gain over the
    # folds. A candidate is better if gain and t exceed ``cv_gain_min`` and ``cv_gain_t_min``, or the two
    # small limits. A different law is better if its gain exceeds ``small_cv_gain_min``.
    cv_gain_min: float = 0.01
    cv_gain_t_min: float = 1.0
    small_cv_gain_min: float = 0.003
    small_cv_gain_t_min: float = 2.0
    # If folds are motions, a larger training gain replaces the large t and keeps a term (UTFPR runs).
    confirming_training_gain_min: float = 0.02

    # Backward elimination
    removal_loss_max: float = 0.003  # max relative increase of the cross-validation error
    removal_screening_loss_max: float = 0.01  # max relative increase of the error on the screening windows

    # Thorough search
    # Max number of candidates that are searched. After a search, a different candidate can be the best one.
    improvement_count_max: int = 2

    # Fits of one candidate
    fit_iterations: int = 8  # iterations in one round of a fit
    fit_round_count_max: int = 6
    round_gain_min: float = 0.004  # The next round starts only if the gain of a round exceeds this value.
    fold_iterations: int = 4  # iterations of a cross-validation fit, which starts at the fit to all windows
    screening_iterations: int = 8  # iterations of a fit with one additional term
    # Every archetype includes a gas force if the temperature explains more than this part of the mean forces.
    # The part is divided by the standard deviation of the force of the run.
    gas_error_percent_min: float = 2.0
    # Asymmetric terms are tried if force and speed explain more than this part of the mean forces.
    asymmetry_error_percent_min: float = 5.0

    # Fit of delay and lags to runs with changing current
    changing_run_count_max: int = 4  # max number of runs to which delay and lags are fitted
    changing_samples_max: int = 3000  # Runs are resampled to about this number of samples.
    changing_rate_Hz_min: float = 50.0
    changing_rate_Hz_max: float = 200.0
    actuation: ActuationSettings = field(
        default_factory=lambda: ActuationSettings(tolerance=1e-2, follow_share_step_min=0.25)
    )


DEFAULT_SETTINGS = SelectionSettings()
