"""Curves of the fitted coefficients versus current and temperature, with linearised standard errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.fit import Identification
from mrdamper.identify.problem import envelope_of
from mrdamper.models.characteristics import default_scope, pick_evenly
from mrdamper.models.dependence import ParameterLaw
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures import fit as plots
from mrdamper.report.figures import small_multiples as panels
from mrdamper.report.figures.palette import TRAINING, colour_of_temperature
from mrdamper.report.identification.campaign import Campaign

TEMPERATURE_COUNT = 41


def coefficient_figure(campaign: Campaign) -> str:
    """Return the coefficients versus current and temperature as SVG, or an empty string."""
    fitted = campaign.fitted
    if fitted.damper.temperature_dependent:
        warm = _tempered_curves(campaign)
        return panels.curves(warm, "temperature") if warm else ""
    curves = _coefficient_curves(fitted)
    return plots.curves(curves, fitted.damper.command_unit) if curves else ""


def _coefficient_curves(fitted: Identification) -> list[plots.CoefficientCurve]:
    """Return the coefficients that depend on current, with their linearised standard errors."""
    low, high = envelope_of(fitted.training).command
    grid = np.linspace(low, high, 81)
    trained = [np.unique(run.trajectory.command[:: max(len(run) // 50, 1)]) for run in fitted.training]
    return [
        plots.CoefficientCurve(
            name,
            fitted.damper.law[name].unit,
            grid,
            form.value(grid),
            _band(fitted, name, form, grid, None),
            np.unique(np.concatenate(trained)),
        )
        for name, form in fitted.damper.coefficients.items()
        if form.kind != "constant" and high > low
    ]


def _tempered_curves(
    campaign: Campaign,
) -> list[tuple[str, str, list[panels.Curve], FloatArray | None]]:
    """Return each coefficient versus current at several temperatures, or versus temperature only."""
    fitted, damper = campaign.fitted, campaign.fitted.damper
    envelope = envelope_of(fitted.training)
    commands = np.linspace(*envelope.command, 81)
    if campaign.warm:
        levels = [degrees + ZERO_CELSIUS_K for degrees in pick_evenly(campaign.levels.values, 4)]
    else:
        levels = [warm for warm in default_scope(damper, envelope).temperatures if warm is not None]
    unit = "current, A" if damper.command_unit == "A" else "voltage, V"
    trained = np.array([c for c in campaign.commands if commands[0] <= c <= commands[-1]])
    found: list[tuple[str, str, list[panels.Curve], FloatArray | None]] = []
    for name, form in damper.coefficients.items():
        title = f"{name.replace('_', ' ')}, {damper.law[name].unit}"
        title += " (assumed)" if name in damper.assumed else ""
        flat = commands[0] == commands[-1] or bool(
            np.ptp(form.value(commands, _like(commands, levels[0]))) == 0.0
        )
        if flat and not form.temperature_dependent:
            continue
        if flat:
            grid = np.linspace(levels[0], levels[-1], TEMPERATURE_COUNT)
            at = np.full(len(grid), commands[0])
            series = panels.Series("", TRAINING, grid - ZERO_CELSIUS_K, form.value(at, grid))
            found.append(
                (title, "temperature, °C", [panels.Curve(series, _band(fitted, name, form, at, grid))], None)
            )
            continue
        bands = []
        for warm in levels if form.temperature_dependent else levels[:1]:
            label = f"{warm - ZERO_CELSIUS_K:.0f} °C" if form.temperature_dependent else ""
            colour = colour_of_temperature(warm, levels) if form.temperature_dependent else TRAINING
            at = _like(commands, warm)
            series = panels.Series(label, colour, commands, form.value(commands, at))
            bands.append(panels.Curve(series, _band(fitted, name, form, commands, at)))
        found.append((title, unit, bands, trained))
    return found


def _like(commands: FloatArray, temperature: float) -> FloatArray:
    return np.full(len(commands), temperature)


def _band(
    fitted: Identification, name: str, form: ParameterLaw, command: FloatArray, temperature: FloatArray | None
) -> FloatArray | None:
    """Return the linearised standard error along a curve of a coefficient, or None if it is not fitted."""
    places = {estimate.name: k for k, estimate in enumerate(fitted.estimates)}
    members = [places.get(f"{name}.{number}") for number in form.parameter_names]
    rows = [row for row, place in enumerate(members) if place is not None]
    chosen = [place for place in members if place is not None]
    return _propagated(fitted, form.gradient(command, temperature)[rows], chosen)


def _propagated(fitted: Identification, gradient: FloatArray, places: Sequence[int]) -> FloatArray | None:
    """Return the standard error along a curve. Parameters at a bound have no uncertainty."""
    if not places:
        return None
    spread = np.nan_to_num(np.array([fitted.estimates[k].standard_error for k in places]))
    correlation = np.nan_to_num(fitted.result.correlation[np.ix_(places, places)])
    covariance = correlation * np.outer(spread, spread)
    variance = np.asarray(np.einsum("ik,ij,jk->k", gradient, covariance, gradient))
    band: FloatArray = np.sqrt(np.maximum(variance, 0.0))
    return band
