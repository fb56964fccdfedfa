"""The picture of a posterior: forces, coefficients and parameters with their 90 % intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import envelope_of
from mrdamper.jobs.identify import IdentifyResult
from mrdamper.models.card_draws import CardDraws
from mrdamper.models.damper import Damper
from mrdamper.quantities import REFERENCE_K
from mrdamper.report.figures.palette import INK, MEASURED, TRAINING
from mrdamper.report.identification.campaign import Campaign
from mrdamper.report.identification.loops import worst_by_motion
from mrdamper.report.identification.traces import trace_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["posterior_figure"]

_DAMPERS = 60  # that an interval is drawn from
_COLUMNS = 4
_WIDE = 10.6  # inches
_MOST_LOOPS = 4
_HEIGHT = 1.95  # inches of a row


def posterior_figure(campaign: Campaign, found: IdentifyResult) -> str:
    """Return the picture; nothing where there are no draws."""
    if found.posterior is None:
        return ""
    # Matplotlib takes long to load, and most reports do without.
    from matplotlib.figure import Figure

    from mrdamper.report.figures.style import drawing_style, svg_of

    draws = found.posterior.draws
    moving = [name for name, form in found.damper.coefficients.items() if form.kind != "constant"]
    loops = worst_by_motion(campaign.errors)[:_MOST_LOOPS]
    counts = (len(loops), len(moving), len(draws.names))
    begins = np.cumsum([0, *(-(-count // _COLUMNS) for count in counts)]).tolist()
    rows = begins[-1]
    with drawing_style():
        figure = Figure(figsize=(_WIDE, _HEIGHT * rows))

        def panel(group: int, k: int) -> Axes:
            return figure.add_subplot(rows, _COLUMNS, _COLUMNS * begins[group] + k + 1)

        for k, error in enumerate(loops):
            _draw_loop(panel(0, k), campaign, draws, error.name)
        for k, name in enumerate(moving):
            _draw_coefficient(panel(1, k), found, draws, name)
        for k in range(len(draws.names)):
            _draw_parameter(panel(2, k), found, draws, k)
        figure.subplots_adjust(
            left=0.05, right=0.99, top=1.0 - 0.1 / rows, bottom=0.2 / rows, wspace=0.3, hspace=0.55
        )
        return svg_of(figure, "Forces, coefficients and parameters with their intervals of 90 percent")


def _band(axes: Axes, x: FloatArray, ends: tuple[FloatArray, FloatArray], value: FloatArray) -> None:
    axes.fill_between(x, *ends, color=TRAINING, alpha=0.25, linewidth=0)
    axes.plot(x, value, color=TRAINING, linewidth=1.0)


def _draw_loop(axes: Axes, campaign: Campaign, draws: CardDraws, name: str) -> None:
    """Draw the force of a run over time, measured, modelled and its interval."""
    error = next(each for each in campaign.errors if each.name == name)
    run, damper = campaign.runs[name], campaign.fitted.damper

    def modelled(of: Damper) -> FloatArray:
        return trace_of(of, run, error).modelled_N

    drawn = trace_of(damper, run, error)
    axes.plot(drawn.time_s, drawn.measured_N, color=MEASURED, linewidth=2.0)
    _band(axes, drawn.time_s, draws.interval(damper, modelled, _DAMPERS), drawn.modelled_N)
    axes.set_title(f"{name[:40]}: force, N", loc="left", pad=3)
    axes.set_xlabel("time, s", labelpad=1.5)


def _draw_coefficient(axes: Axes, found: IdentifyResult, draws: CardDraws, name: str) -> None:
    """Draw a coefficient over the command, at 20 degC where it depends on temperature."""
    damper, unit = found.damper, found.damper.command_unit
    command = np.linspace(*envelope_of(found.training).command, 41)
    warm = np.full(len(command), REFERENCE_K)

    def along(of: Damper) -> FloatArray:
        return np.asarray(of.coefficients[name].value(command, warm))

    _band(axes, command, draws.interval(damper, along, len(draws)), along(damper))
    axes.set_title(f"{name.replace('_', ' ')}, {damper.law[name].unit}", loc="left", pad=3)
    axes.set_xlabel("current, A" if unit == "A" else "voltage, V", labelpad=1.5)


def _draw_parameter(axes: Axes, found: IdentifyResult, draws: CardDraws, k: int) -> None:
    """Draw the draws of a parameter as a histogram, its interval and the best fit."""
    values, name = draws.values[:, k], draws.names[k]
    axes.hist(values, bins=40, color=TRAINING, alpha=0.5)
    for end in draws.percentiles[name]:
        axes.axvline(end, color=TRAINING, linewidth=0.8)
    axes.axvline(found.damper.parameters_and_lag[name], color=INK, linewidth=1.0)
    axes.set_yticks([])
    axes.locator_params(axis="x", nbins=4)
    axes.set_title(_titled(name, found), loc="left", pad=3)


def _titled(name: str, found: IdentifyResult) -> str:
    unit = found.damper.units.get(name, "s")
    return name.removesuffix(".value").replace("_", " ") + ("" if unit == "-" else f", {unit}")
