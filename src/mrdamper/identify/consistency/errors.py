"""Compare the training error and the cross-validation error of one fit."""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.data.finding import Finding
from mrdamper.identify.consistency.settings import SETTINGS
from mrdamper.identify.scores import ErrorSummary


def find_contradictions(errors: Sequence[ErrorSummary]) -> tuple[Finding, ...]:
    """Return a finding if the training error is much larger than the cross-validation error.

    Normally, the error on the fitted runs is smaller than the error in the cross-validation. A larger error
    on the fitted runs has two possible causes: model selection and final fit used different data, or the
    final fit is not at the minimum. Only runs with constant current are compared, because the law is fitted
    only to such runs.
    """
    constant = {error.kind: error.rms_percent for error in errors if error.current == "constant"}
    training_percent, cv_percent = constant.get("training"), constant.get("cross_validation")
    if training_percent is None or cv_percent is None:
        return ()
    ratio = training_percent / cv_percent
    if not ratio > SETTINGS.training_cv_ratio_max:
        return ()
    return (
        Finding(
            kind="errors_contradict",
            size=ratio,
            found=f"the training error of the model is {training_percent:.3g} %, and its cross-validation "
            f"error in the selection is {cv_percent:.3g} %",
            effect="The model was selected on data that do not represent all runs, or the final fit is not "
            "at its minimum",
            remedy="Fit each part of the data alone, or choose the model with mrdamper fit --law and "
            "compare the errors",
        ),
    )
