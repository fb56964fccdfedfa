"""HTML page of a fit: declaration of its top, tables and figures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from mrdamper.data.finding import by_kind
from mrdamper.identify.fit import Identification
from mrdamper.identify.problem import envelope_of
from mrdamper.identify.scores import RunError, summary
from mrdamper.jobs.evaluate import coefficient_intervals, force_interval
from mrdamper.jobs.fit import FitResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.runs import errors_figure, interval_figure
from mrdamper.report.identification.campaign import Campaign, OperatingPoints
from mrdamper.report.identification.coefficients import coefficient_figure
from mrdamper.report.identification.loops import (
    find_worst_by_motion,
    loop_pictures,
    overview,
    residual_figure,
)
from mrdamper.report.identification.scores import error_table, pooled_table
from mrdamper.report.identification.tables import (
    candidate_table,
    coefficient_table,
    correlation_table,
    error_summary_table,
)
from mrdamper.report.identification.temperature import characteristics_section, temperature_section
from mrdamper.report.identification.verdict import (
    assumption_flags,
    convergence_sentence,
    expected_tile,
    verdict_lines,
)
from mrdamper.report.page import FirstScreen, Page, Tile, count_of, range_of
from mrdamper.report.sections import Picture, Section


def _first(fitted: FitResult) -> FirstScreen:
    judged, law, result = fitted.assessment, fitted.damper.law, fitted.result
    campaign = Campaign(fitted, judged.runs)
    unit = fitted.damper.command_unit
    unseen = [e for e in judged.runs if e.split == "held_out"]
    scored = unseen or list(judged.runs)
    errors, rms = summary(scored), sorted(e.rmse_N for e in scored)
    what = count_of(f"{'held-out' if unseen else 'training'} run", len(scored))
    known = sum(each.identifiable for each in fitted.estimates)
    over = range_of(envelope_of(fitted.training).command, unit)
    flags = [("These runs are simulated, not measured", fitted.simulated)] if fitted.simulated else []
    flags += assumption_flags(fitted.damper)
    if not fitted.converged:
        flags.insert(0, ("Not converged", convergence_sentence(fitted)))
    if not unseen:
        remedy = "Hold out some runs to test the model on data that the fit did not use"
        flags.append(("No run was held out", remedy))
    return FirstScreen(
        title=fitted.title or "MR damper identification",
        subject=f"{law.title} ({law.name}), fitted to {len(fitted.training)} runs over {over} by "
        f"{_METHODS.get(result.method, result.method)}.",
        verdict=" ".join(verdict_lines(fitted)),
        tiles=(
            Tile(
                f"{errors['median']:.1f} %",
                f"error on {what}, median",
                f"worst {errors['worst']:.1f} %",
            ),
            Tile(
                f"{np.median(rms):.3g} N", f"RMS error on {what}, median", f"{rms[0]:.3g} to {rms[-1]:.3g} N"
            ),
            expected_tile(fitted.force_band)
            or Tile(f"{known} of {len(fitted.estimates)}", "parameters that these runs determine"),
        ),
        caption=f"{campaign.main or 'the worst runs'}: measured force in grey, modelled force in colour. The "
        "RMS error is above each column, in red for held-out runs",
        flags=flags,
        notes=(
            *result.notes,
            *judged.words,
            *(f"Suggested test: {test}." for test in fitted.next_tests),
        ),
    )


def _picture(fitted: FitResult) -> Figure:
    return overview(Campaign(fitted, fitted.assessment.runs))


def _sections(fitted: FitResult) -> list[Section]:
    """Return the tables of a fit. The template of the page places figures and values between the tables."""
    campaign = Campaign(fitted, fitted.assessment.runs)
    ordered = sorted(campaign.errors, key=partial(_order, levels=campaign.levels))
    selection = [] if fitted.selection is None else [candidate_table(fitted.selection)]
    return [
        error_summary_table(fitted.errors),
        error_table(ordered),
        coefficient_table(fitted.estimates),
        *selection,
    ]


def _values(fitted: FitResult) -> dict[str, object]:
    """Return the values that the page template prints below the first screen."""
    campaign = Campaign(fitted, fitted.assessment.runs)
    return {
        "unit": fitted.damper.command_unit,
        "warm": campaign.warm,
        "loops": loop_pictures(campaign),
        "findings": by_kind(fitted.findings),
        "inferred": [each.in_words() for each in fitted.inferred],
        "characteristics": characteristics_section(campaign),
        "warmth": temperature_section(campaign),
        "errors": Picture("Error by run", lambda: errors_figure(campaign.errors)),
        "tables": _sections(fitted),
        "pooled": pooled_table(campaign.errors),
        "residuals": Picture("Residual force", lambda: residual_figure(campaign)),
        "curves": Picture("Coefficients", lambda: coefficient_figure(campaign)),
        "correlations": correlation_table(fitted.result),
        "intervals": Picture("90 % intervals", lambda: _interval_figure(campaign, fitted)),
        "envelope": _envelope_rows(fitted),
        "preparation": _preparation_rows(fitted),
    }


def _interval_figure(campaign: Campaign, fitted: FitResult) -> Figure | None:
    """Return a figure of forces and coefficients with 90 % intervals; None without posterior samples."""
    damper, samples = fitted.damper, fitted.posterior
    if samples is None:
        return None
    few = samples.dampers(damper, 60)  # The number is limited because each sample needs a simulation.
    worst = find_worst_by_motion(campaign.errors)[:4]
    forces = [force_interval(damper, few, campaign.runs[error.name]) for error in worst]
    dampers, command = samples.dampers(damper, len(samples)), envelope_of(fitted.training).command
    return interval_figure(forces, coefficient_intervals(damper, dampers, command), damper.command_unit)


_METHODS: Mapping[str, str] = {
    "varpro": "variable projection",
    "genetic": "genetic algorithm",
}


def _order(error: RunError, levels: OperatingPoints) -> tuple[list[tuple[str, float]], float, float, str]:
    """Return the sort key of a run: motion (numbers in its label as numbers), temperature, current, name."""
    parts = re.findall(r"([^\d]*)(\d+(?:\.\d+)?)?", error.motion)
    motion = [(text, float(number or 0.0)) for text, number in parts]
    warm = levels.level_of(error) if levels.kind == "temperature" else None
    return motion, warm or 0.0, np.inf if error.command is None else error.command, error.name


def _envelope_rows(fitted: Identification) -> list[tuple[str, str]]:
    envelope = envelope_of(fitted.training)
    unit = fitted.damper.command_unit
    rows = [
        ("current" if unit == "A" else "voltage", range_of(envelope.command, unit)),
        ("displacement", range_of([1e3 * end for end in envelope.displacement], "mm")),
        ("velocity", range_of([1e3 * end for end in envelope.velocity], "mm/s")),
    ]
    if envelope.temperature is None:
        return [*rows, ("temperature", "not recorded")]
    return [*rows, ("temperature", range_of([end - ZERO_CELSIUS_K for end in envelope.temperature], "°C"))]


def _preparation_rows(fitted: Identification) -> list[tuple[str, str]]:
    chosen = fitted.preparation
    cut = sorted(run.cutoff_Hz for run in fitted.training)
    dead = sorted(1e6 * run.trajectory.dead_band for run in fitted.training)
    zero = {"start": "rest before the motion", "mean": "mean", "none": "as measured"}[chosen.reference]
    offset = f"an offset of {chosen.force_offset_N:g} N was subtracted"
    rate = f"at most {fitted.problem.settings.rate_Hz:g} Hz. Errors are computed at the rate of the file"
    return [
        ("low-pass of the displacement", f"{cut[0]:.3g} to {cut[-1]:.3g} Hz, zero phase"),
        ("reversal dead band", f"{dead[0]:.3g} to {dead[-1]:.3g} µm"),
        ("zero of displacement", zero),
        ("velocity", "from the smoothed displacement"),
        ("force", offset if chosen.force_offset_N else "as measured"),
        ("sample rate of the fit", rate),
    ]


PAGE = Page(
    name="report.html",
    first=_first,
    picture=_picture,
    label="Loops, measured and modelled",
    template="report.html.j2",
    sections=_sections,
    values=_values,
)
