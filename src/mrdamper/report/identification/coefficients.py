"""Curves of the fitted coefficients versus current and temperature, with linearised standard errors."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.identify.fit import Identification
from mrdamper.identify.problem import envelope_of
from mrdamper.models.characteristics import default_scope, pick_evenly
from mrdamper.models.dependence import ParameterLaw
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import TRAINING, colour_of_temperature
from mrdamper.report.identification.campaign import Campaign

POINT_COUNT = 81


def coefficient_figure(campaign: Campaign) -> Figure | None:
    """Return a figure of all coefficients that depend on current or temperature.

    A coefficient that depends on current is plotted versus current at several temperatures. Any other
    coefficient is plotted versus temperature. Dots mark the currents of the runs. The function returns None
    if all coefficients are constant.
    """
    fitted, damper = campaign.fitted, campaign.fitted.damper
    envelope = envelope_of(fitted.training)
    levels = [degrees + ZERO_CELSIUS_K for degrees in pick_evenly(campaign.levels.values, 4)]
    if not campaign.warm:
        levels = [warm or REFERENCE_K for warm in default_scope(damper, envelope).temperatures]
    low, high = envelope.command
    commands = np.linspace(low, high, POINT_COUNT)
    dots = [command for command in campaign.commands if low <= command <= high]
    drawn = []
    for name, form in damper.coefficients.items():
        assumed = " (assumed)" if name in damper.assumed else ""
        title = f"{name.replace('_', ' ')}, {damper.law[name].unit}{assumed}"
        kelvin = np.full(POINT_COUNT, levels[0])
        if low < high and np.ptp(form.value(commands, kelvin)) > 0.0:
            lines = []
            for warm in levels if form.temperature_dependent else levels[:1]:
                kelvin = np.full(POINT_COUNT, warm)
                value = form.value(commands, kelvin)
                band = _band(fitted, name, form, commands, kelvin)
                colour, label = TRAINING, ""
                if form.temperature_dependent:
                    colour, label = colour_of_temperature(warm, levels), f"{warm - ZERO_CELSIUS_K:.0f} °C"
                lines.append(Line(commands, value, colour, label, band=band, dots=dots))
            drawn.append(Panel(title, campaign.command_label, lines))
        elif form.temperature_dependent:
            kelvin = np.linspace(levels[0], levels[-1], POINT_COUNT)
            at = np.full(POINT_COUNT, low)
            band = _band(fitted, name, form, at, kelvin)
            line = Line(kelvin - ZERO_CELSIUS_K, form.value(at, kelvin), TRAINING, band=band)
            drawn.append(Panel(title, "temperature, °C", [line]))
    return panel_figure(drawn, legend="temperature") if drawn else None


def _band(
    fitted: Identification, name: str, form: ParameterLaw, command: FloatArray, kelvin: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return a coefficient minus and plus its standard error; None if not fitted.

    The standard error of a parameter at a bound counts as zero.
    """
    places = {estimate.name: k for k, estimate in enumerate(fitted.estimates)}
    members = [places.get(f"{name}.{number}") for number in form.parameter_names]
    rows = [row for row, place in enumerate(members) if place is not None]
    chosen = [place for place in members if place is not None]
    if not chosen:
        return None
    gradient, value = form.gradient(command, kelvin)[rows], form.value(command, kelvin)
    spread = np.nan_to_num(np.array([fitted.estimates[k].standard_error for k in chosen]))
    covariance = np.nan_to_num(fitted.result.correlation[np.ix_(chosen, chosen)]) * np.outer(spread, spread)
    error = np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", gradient, covariance, gradient), 0.0))
    return value - error, value + error
