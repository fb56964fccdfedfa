"""Compare the held-out error, the training error and the cross-validation error of one fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mrdamper.arrays import rms
from mrdamper.data.finding import Finding
from mrdamper.identify.consistency.settings import DEFAULTS, ConsistencySettings
from mrdamper.identify.scores import RunError
from mrdamper.identify.selection.select import CandidateScore

ErrorKind = Literal["held_out", "training", "cross_validation"]
CurrentKind = Literal["constant", "changing"]


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Median, RMS and maximum of the errors ``nrmse_percent`` of a set of runs.

    ``kind`` states whether the runs are held-out runs, training runs or runs of the cross-validation.
    """

    kind: ErrorKind
    current: CurrentKind
    run_count: int
    median_percent: float
    rms_percent: float
    worst_percent: float


def summarize_errors(
    runs: Sequence[RunError], chosen: CandidateScore | None = None
) -> tuple[ErrorSummary, ...]:
    """Return the error statistics of held-out runs, training runs and cross-validation.

    There are separate statistics for constant and for changing current. Statistics without any run are
    omitted. ``chosen`` is the score of the selected candidate, which contains the cross-validation errors. If
    the user specified the model, ``chosen`` is missing because there was no selection.
    """
    errors: dict[tuple[ErrorKind, CurrentKind], list[float]] = {
        (kind, current): [] for kind in get_args(ErrorKind) for current in get_args(CurrentKind)
    }
    for run in runs:
        errors[run.split, "changing" if run.command is None else "constant"].append(run.nrmse_percent)
    if chosen is not None:
        by_current = (chosen.cv_percent_by_run, chosen.changing_percent_by_run)
        for current, percents in zip(get_args(CurrentKind), by_current, strict=True):
            errors["cross_validation", current] += percents
    return tuple(
        ErrorSummary(kind, current, len(values), float(np.median(values)), rms(np.array(values)), max(values))
        for (kind, current), values in errors.items()
        if values
    )


def find_contradictions(
    errors: Sequence[ErrorSummary], settings: ConsistencySettings = DEFAULTS
) -> tuple[Finding, ...]:
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
    if not ratio > settings.training_cv_ratio_max:
        return ()
    return (
        Finding(
            kind="errors_contradict",
            severity="warning",
            channel="",
            size=ratio,
            found=f"the training error of the model is {training_percent:.3g} %, and its cross-validation "
            f"error in the selection is {cv_percent:.3g} %",
            effect="The model was selected on data that do not represent all runs, or the final fit is not "
            "at its minimum",
            remedy="Fit each part of the data alone, or choose the model with mrdamper fit --law and "
            "compare the errors",
        ),
    )
