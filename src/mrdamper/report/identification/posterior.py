"""Figure of a posterior: forces, coefficients and parameters with their 90 % intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper.identify.problem import envelope_of
from mrdamper.jobs.fit import FitResult
from mrdamper.jobs.intervals import coefficient_intervals, force_interval
from mrdamper.report.figures.intervals import Histogram, Panel, coefficient_panels, force_panels, panel_figure
from mrdamper.report.figures.style import svg_drawn_by
from mrdamper.report.identification.campaign import Campaign
from mrdamper.report.identification.loops import find_worst_by_motion

SAMPLE_COUNT_MAX = 60  # Each posterior sample needs a simulation.
LOOP_COUNT_MAX = 4


def posterior_figure(campaign: Campaign, found: FitResult) -> str:
    """Return the figure as SVG, or an empty string without posterior samples."""
    if found.posterior is None:
        return ""
    damper, draws = found.damper, found.posterior
    few = draws.dampers(damper, SAMPLE_COUNT_MAX)
    worst = find_worst_by_motion(campaign.errors)[:LOOP_COUNT_MAX]
    forces = [force_interval(damper, few, campaign.runs[error.name]) for error in worst]
    coefficients = coefficient_intervals(
        damper, draws.dampers(damper, len(draws)), envelope_of(found.training).command
    )
    groups: list[Sequence[Panel | Histogram]] = [
        force_panels(forces),
        coefficient_panels(coefficients, damper.command_unit),
        [_histogram(found, k) for k in range(len(draws.names))],
    ]
    label = "90 % intervals of forces, coefficients and parameters"
    return svg_drawn_by(lambda: panel_figure(groups), label)


def _histogram(found: FitResult, k: int) -> Histogram:
    """Return the histogram of a parameter's posterior samples with the interval and the best fit."""
    assert found.posterior is not None
    draws = found.posterior
    name = draws.names[k]
    counts, edges = np.histogram(draws.values[:, k], bins=40)
    best = found.damper.parameters_and_lag[name]
    return Histogram(_title(name, found), counts, edges, draws.percentiles[name], best)


def _title(name: str, found: FitResult) -> str:
    unit = found.damper.units.get(name, "s")
    return name.removesuffix(".value").replace("_", " ") + ("" if unit == "-" else f", {unit}")
