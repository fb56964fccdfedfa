"""Page of a fit. All values follow from the fit and its assessment."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from mrdamper.data.finding import by_kind
from mrdamper.identify.fit import Identification
from mrdamper.identify.problem import envelope_of
from mrdamper.identify.scores import RunError, summary
from mrdamper.jobs.fit import FitResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures import fit as plots
from mrdamper.report.identification.campaign import Campaign
from mrdamper.report.identification.coefficients import coefficient_figure
from mrdamper.report.identification.groups import OperatingPoints
from mrdamper.report.identification.loops import (
    error_section,
    find_worst_by_motion,
    loop_pictures,
    overview,
    residual_picture,
)
from mrdamper.report.identification.posterior import posterior_figure
from mrdamper.report.identification.scores import error_table
from mrdamper.report.identification.tables import (
    candidate_table,
    coefficient_table,
    error_summary_table,
)
from mrdamper.report.identification.temperature import (
    assumption_sentence,
    characteristics_section,
    temperature_section,
)
from mrdamper.report.identification.traces import traces_of
from mrdamper.report.identification.verdict import convergence_sentence, verdict_lines
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import Section

LOOP_COUNT_MAX = 48  # Campaigns with more runs are shown by motion and temperature.
RESIDUAL_FIGURE_COUNT_MAX = 6  # Campaigns with more motions have one common figure of residuals.


@dataclass(frozen=True, slots=True)
class _Group:
    """The loops of one motion."""

    motion: str
    loops: tuple[tuple[plots.Trace, str], ...]  # with the SVG


def _first(fitted: FitResult) -> FirstScreen:
    judged, law, result = fitted.assessment, fitted.damper.law, fitted.result
    campaign = Campaign(fitted, judged.runs)
    unit = fitted.damper.command_unit
    unseen = [e for e in judged.runs if e.split == "held_out"]
    scored = unseen or list(judged.runs)
    errors, rms = summary(scored), sorted(e.rmse_N for e in scored)
    what = f"{len(scored)} {'held-out' if unseen else 'training'} run{'' if len(scored) == 1 else 's'}"
    known = sum(each.identifiable for each in fitted.estimates)
    over = _range(envelope_of(fitted.training).command, unit)
    flags = [("These runs are simulated, not measured", fitted.simulated)] if fitted.simulated else []
    if assumed := assumption_sentence(campaign):
        text = f"{assumed} Values based on it are marked as assumed"
        flags.append(("The temperature dependence is assumed", text))
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
            _expected(fitted)
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


def _expected(fitted: FitResult) -> Tile | None:
    """Return the expected error of new runs from cross-validation."""
    band = fitted.force_band
    if band is None:
        return None
    worst = f"worst {band.worst_nrmse_percent:.1f} %, cross-validation over {band.left_out}"
    return Tile(f"{band.expected_nrmse_percent:.1f} %", "expected error of new runs, median", worst)


def _picture(fitted: FitResult) -> Figure:
    return overview(Campaign(fitted, fitted.assessment.runs))


def _sections(fitted: FitResult) -> list[Section]:
    """Return the tables of a fit. The page also has figures and values between them."""
    judged = fitted.assessment
    selection = [] if fitted.selection is None else [candidate_table(fitted.selection)]
    errors = error_table(_ordered(Campaign(fitted, judged.runs)))
    return [
        error_summary_table(fitted.errors),
        *selection,
        errors,
        coefficient_table(fitted.estimates),
    ]


def _ordered(campaign: Campaign) -> list[RunError]:
    return sorted(campaign.errors, key=partial(_order, levels=campaign.levels))


def _values(fitted: FitResult) -> dict[str, object]:
    """Return the values of the template below the first screen."""
    judged = fitted.assessment
    campaign = Campaign(fitted, judged.runs)
    ordered = _ordered(campaign)
    return {
        "law": fitted.damper.law,
        "result": fitted.result,
        "envelope": _envelope_rows(fitted),
        "zero": f"0 {fitted.damper.command_unit}",
        "unit": fitted.damper.command_unit,
        "warm": campaign.warm,
        "error_table": error_table(ordered),
        **_figures(campaign, ordered),
        "warmth": temperature_section(campaign),
        "characteristics": characteristics_section(campaign),
        **_coefficients(campaign),
        "posterior": fitted.posterior,
        "posterior_picture": posterior_figure(campaign, fitted),
        "findings": by_kind(fitted.findings),
        "inferred": [each.in_words() for each in fitted.inferred],
        "error_summary": error_summary_table(fitted.errors),
        "candidate_table": None if fitted.selection is None else candidate_table(fitted.selection),
        "passivity": judged.passivity_min,
        "preparation": _preparation_rows(fitted),
        "fingerprint": fitted.fingerprint,
    }


def _figures(campaign: Campaign, ordered: Sequence[RunError]) -> dict[str, object]:
    """Return loops, errors and residuals, of each run or by motion and level if there are many runs."""
    many = len(ordered) > LOOP_COUNT_MAX
    grouped = many or campaign.warm
    if grouped:
        drawn = _traces(campaign, find_worst_by_motion(campaign.errors)[:RESIDUAL_FIGURE_COUNT_MAX])
    else:
        drawn = _select_traces(campaign)
    bars = sorted(ordered, key=lambda error: error.split != "training")
    return {
        "many": many,
        "error_bars": "" if many else plots.errors([(e.name, e.split, e.nrmse_percent) for e in bars]),
        "error_section": error_section(campaign) if grouped else None,
        "loop_pictures": loop_pictures(campaign) if grouped else [],
        "groups": _groups(drawn, campaign.highest),
        "residual_picture": residual_picture(campaign) if grouped else None,
        "residuals": _residuals(_cell_traces(campaign) if grouped else drawn, campaign.highest),
        "energies": plots.energies(
            [(e.command, e.split, e.energy_measured_J, e.energy_model_J) for e in campaign.errors],
            campaign.highest,
        ),
    }


def _coefficients(campaign: Campaign) -> dict[str, object]:
    estimates, correlation = campaign.fitted.estimates, campaign.fitted.result.correlation
    moving = [k for k, e in enumerate(estimates) if not e.at_bound]
    names = [estimates[k].name for k in moving]
    matrix = correlation[np.ix_(moving, moving)]
    return {
        "estimates": coefficient_table(estimates),
        "curves": coefficient_figure(campaign),
        "correlations": plots.correlations(names, matrix) if len(moving) > 1 else "",
    }


_METHODS: Mapping[str, str] = {
    "varpro": "variable projection",
    "genetic": "genetic algorithm",
}


# ------------------------------------------------------------------------------------------- traces


def _select_traces(campaign: Campaign) -> list[plots.Trace]:
    """Return the traces of each run by motion and current, or of the worst runs if there are many."""
    chosen = sorted(campaign.errors, key=lambda e: -e.nrmse_percent)[:LOOP_COUNT_MAX]
    return _traces(campaign, sorted(chosen, key=_order))


def _traces(campaign: Campaign, errors: Sequence[RunError]) -> list[plots.Trace]:
    return traces_of(campaign.fitted.damper, [(campaign.runs[error.name], error) for error in errors])


def _groups(traces: Sequence[plots.Trace], highest: float) -> list[_Group]:
    """Return the loops by motion. All loops of a motion have the same axes."""
    groups = []
    for motion in dict.fromkeys(trace.motion for trace in traces):
        members = [trace for trace in traces if trace.motion == motion]
        limits = plots.Limits.from_traces(members)
        drawn = tuple((trace, plots.loops(trace, limits, highest)) for trace in members)
        groups.append(_Group(motion, drawn))
    return groups


def _residuals(traces: Sequence[plots.Trace], highest: float) -> list[tuple[str, str]]:
    """Return the residuals of the traces, in one figure for each motion if there are few motions."""
    motions = list(dict.fromkeys(trace.motion for trace in traces))
    if len(motions) > RESIDUAL_FIGURE_COUNT_MAX:
        return [("all motions", plots.residuals(traces, "all motions", highest))]
    of_motion = {motion: [trace for trace in traces if trace.motion == motion] for motion in motions}
    return [(motion, plots.residuals(members, motion, highest)) for motion, members in of_motion.items()]


def _cell_traces(campaign: Campaign) -> list[plots.Trace]:
    """Return one run of each motion and current, if the residuals are not drawn by temperature."""
    if campaign.warm:
        return []
    motions = list(dict.fromkeys(error.motion for error in campaign.errors))[:RESIDUAL_FIGURE_COUNT_MAX]
    cells = [campaign.find_run(motion, None, command) for motion in motions for command in campaign.commands]
    return [campaign.trace(error) for error in cells if error is not None]


def _order(
    error: RunError, levels: OperatingPoints | None = None
) -> tuple[list[tuple[str, float]], float, float, str]:
    """Return the sort key of a run: motion with its numbers, temperature, current, name."""
    parts = re.findall(r"([^\d]*)(\d+(?:\.\d+)?)?", error.motion)
    motion = [(text, float(number or 0.0)) for text, number in parts]
    warm = levels.level_of(error) if levels is not None and levels.kind == "temperature" else None
    return motion, warm or 0.0, np.inf if error.command is None else error.command, error.name


# ------------------------------------------------------------------------------------------- numbers


def _range(pair: tuple[float, float], unit: str, scale: float = 1.0) -> str:
    low, high = (scale * end for end in pair)
    return f"{low:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"


def _envelope_rows(fitted: Identification) -> list[tuple[str, str]]:
    envelope = envelope_of(fitted.training)
    unit = fitted.damper.command_unit
    rows = [
        ("current" if unit == "A" else "voltage", _range(envelope.command, unit)),
        ("displacement", _range(envelope.displacement, "mm", 1e3)),
        ("velocity", _range(envelope.velocity, "mm/s", 1e3)),
    ]
    if envelope.temperature is None:
        return [*rows, ("temperature", "not recorded")]
    low, high = envelope.temperature
    return [*rows, ("temperature", _range((low - ZERO_CELSIUS_K, high - ZERO_CELSIUS_K), "°C"))]


def _preparation_rows(fitted: Identification) -> list[tuple[str, str]]:
    chosen = fitted.preparation
    cut = sorted(run.cutoff_Hz for run in fitted.training)
    dead = sorted(1e6 * run.dead_band_m for run in fitted.training)
    by_rule = "computed from each run: "
    return [
        (
            "low-pass of the displacement",
            ("" if chosen.cutoff_Hz is not None else by_rule)
            + f"{cut[0]:.3g} to {cut[-1]:.3g} Hz, zero phase",
        ),
        (
            "reversal dead band",
            ("" if chosen.dead_band_m is not None else by_rule) + f"{dead[0]:.3g} to {dead[-1]:.3g} µm",
        ),
        (
            "zero of displacement",
            {"start": "rest before the motion", "mean": "mean", "none": "as measured"}[chosen.reference],
        ),
        (
            "velocity",
            "from the smoothed displacement" if chosen.velocity == "displacement" else "measured channel",
        ),
        (
            "force",
            f"an offset of {chosen.force_offset_N:g} N was subtracted"
            if chosen.force_offset_N
            else "as measured",
        ),
        (
            "sample rate of the fit",
            f"at most {fitted.problem.settings.rate_Hz:g} Hz. Errors are computed at the rate of the file",
        ),
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
