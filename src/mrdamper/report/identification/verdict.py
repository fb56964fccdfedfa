"""Sentences that judge a fit: convergence, errors, expected error of new runs."""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.identify.scores import RunError, summary
from mrdamper.jobs.fit import FitResult
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.report.page import Tile, count_of


def convergence_sentence(found: FitResult) -> str:
    """Return a sentence if the fit has not converged, otherwise an empty string."""
    if found.result.cancelled:
        return "The fit has not converged because it was interrupted. Do not use its parameters."
    if not found.converged:
        return (
            "The fit has not converged. Its parameters are the best so far, and other values can fit better."
        )
    return ""


def verdict_lines(found: FitResult) -> list[str]:
    """Return the verdict, most important statement first: convergence, then the errors."""
    errors = found.assessment.runs
    held_out = [error for error in errors if error.split == "held_out"]
    training = [error for error in errors if error.split == "training"]
    lines = [convergence_sentence(found), _errors("Held-out runs", held_out)]
    if not held_out:
        lines.append(_cross_validation(found))
    lines += [_errors("Training runs", training), expected_sentence(found)]
    return [line for line in lines if line]


def assumption_flags(damper: Damper) -> list[tuple[str, str]]:
    """Return a warning if the temperature dependence of a damper was assumed instead of fitted."""
    if not damper.assumed:
        return []
    names = ", ".join(name.replace("_", " ") for name in damper.assumed)
    text = f"The temperature factor of {names} was taken from a fluid, not fitted to this damper"
    return [("The temperature dependence is assumed", text)]


def expected_tile(band: ForceBand | None) -> Tile | None:
    """Return the expected error of new runs from cross-validation, or None if it is unknown."""
    if band is None:
        return None
    worst = f"worst {band.worst_nrmse_percent:.1f} %, cross-validation over {band.left_out}"
    return Tile(f"{band.expected_nrmse_percent:.1f} %", "expected error of new runs, median", worst)


def expected_sentence(found: FitResult) -> str:
    """Return a sentence with the expected error of new runs; an empty string if it is unknown."""
    band = found.force_band
    if band is None:
        return ""
    return (
        f"New runs: expect a median error of {band.expected_nrmse_percent:.1f} %, at worst "
        f"{band.worst_nrmse_percent:.1f} %."
    )


def _errors(name: str, errors: Sequence[RunError]) -> str:
    if not errors:
        return ""
    values = summary(errors)
    runs = count_of("run", len(errors))
    return f"{name}: median error {values['median']:.1f} %, worst {values['worst']:.1f} % ({runs})."


def _cross_validation(found: FitResult) -> str:
    if found.selection is None or not found.selection.scores[0].cv_percent_by_run:
        return ""
    score = found.selection.scores[0]
    return (
        f"Cross-validation: median error {score.cv_median_percent:.1f} %, worst "
        f"{score.cv_worst_percent:.1f} % ({found.selection.validation_data})."
    )
