"""Settings of the model selection: thresholds that decide which law and terms are chosen."""

from __future__ import annotations

from dataclasses import dataclass, fields

from mrdamper.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionSettings:
    """Limits and thresholds of the model selection.

    Errors are root-mean-square errors in percent of the standard deviation of the force. A *ratio* divides an
    error by the smallest error of the same kind. A *gain* is a relative decrease of an error: 0.01 means 1 %.

    Parameters
    ----------
    samples_max : simulated samples of the windows to which candidates are fitted
    subset_error_ratio_max : repeat the selection with more windows if the error of the chosen candidate on
        all runs divided by its error on the windows is larger
    subset_growth : factor of ``samples_max`` of such a repetition
    training_error_ratio_max : drop laws with a larger ratio of training errors; modular laws are kept because
        their first candidates have few terms. Also applied on screening windows, to end such fits early
    finalist_count_max : cross-validate at most this number of laws, and all further modular laws
    archetype_error_ratio_max : cross-validate the archetypes of a law up to this ratio of training errors
    law_cv_ratio_max : add no terms to a law with a larger ratio of cross-validation errors, unless the law is
        modular
    continue_cv_ratio_max : stop adding terms if the ratio of cross-validation errors is still larger after a
        round, unless the law is modular
    round_count_max, modular_round_count_max : rounds of adding terms to a law
    term_count_max, modular_term_count_max : terms to fit in each round
    training_gain_min : required gain in training error; a smaller one is unlikely to be significant in
        cross-validation. Also required on screening windows, unless the law is modular
    training_gain_fraction_min : after a term was accepted, cross-validate another term of the same round only
        if its gain in training error is at least this fraction of the accepted one
    cv_gain_min, cv_gain_t_min : a candidate is better if its cross-validation gain and the gain's Student's t
        over the folds exceed these values
    small_cv_gain_min, small_cv_gain_t_min : alternatively, a smaller gain with a larger t is sufficient
    removal_loss_max : remove a term if the cross-validation error increases by less than this fraction
    removal_screening_loss_max : keep a term of a modular law if the error on screening windows increases by
        more than this fraction without the term
    improvement_count_max : candidates that are searched for other minima, one after the other, as long as the
        search makes the best candidate worse than another one
    fit_iterations, fit_round_count_max, round_gain_min : iterations of one round of a fit, rounds at most,
        and the gain in error of a round that is required for another one
    fold_iterations : iterations of a fit without one fold, from the fit to all windows
    screening_iterations : iterations on screening windows of a candidate with one more term
    twin_error_ratio_max : decide between two solutions of an archetype by the runs with changing current if
        the ratio of their errors is smaller
    gas_error_percent_min : start with a gas force if the mean forces of the runs depend on temperature so
        much
    asymmetry_error_percent_min : start with asymmetric forces, too, if mean forces grow with force so much
    changing_run_count_max : runs with changing current to which the response to the current is fitted
    changing_samples_max, changing_rate_Hz_min, changing_rate_Hz_max : runs with changing current are
        sampled at a rate that gives this number of samples, within these limits
    changing_tolerance : relative tolerance of this fit
    """

    # Data
    samples_max: int = 15_000
    subset_error_ratio_max: float = 1.2
    subset_growth: float = 3.0

    # Screening
    training_error_ratio_max: float = 1.5
    finalist_count_max: int = 3

    # Forward selection
    archetype_error_ratio_max: float = 1.2
    law_cv_ratio_max: float = 1.2
    continue_cv_ratio_max: float = 1.05
    round_count_max: int = 2
    modular_round_count_max: int = 8
    term_count_max: int = 2
    modular_term_count_max: int = 3
    training_gain_min: float = 0.003
    training_gain_fraction_min: float = 0.25

    # Comparison of two candidates
    cv_gain_min: float = 0.01
    cv_gain_t_min: float = 1.0
    small_cv_gain_min: float = 0.003
    small_cv_gain_t_min: float = 2.0

    # Backward elimination
    removal_loss_max: float = 0.003
    removal_screening_loss_max: float = 0.01

    # Thorough search
    improvement_count_max: int = 3

    # Fits of one candidate
    fit_iterations: int = 8
    fit_round_count_max: int = 6
    round_gain_min: float = 0.004
    fold_iterations: int = 4
    screening_iterations: int = 8
    twin_error_ratio_max: float = 1.2
    gas_error_percent_min: float = 2.0
    asymmetry_error_percent_min: float = 5.0
    changing_run_count_max: int = 4
    changing_samples_max: int = 3000
    changing_rate_Hz_min: float = 50.0
    changing_rate_Hz_max: float = 200.0
    changing_tolerance: float = 1e-2

    def __post_init__(self) -> None:
        """Raise InputError if a ratio or a number of laws, rounds or terms is below 1."""
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if name.endswith(("_ratio_max", "_count_max")) and not value >= 1:
                raise InputError(
                    f"the value is {value}", place=f"SelectionSettings.{name}", expected="1 or more"
                )


DEFAULT_SETTINGS = SelectionSettings()
