"""Figure of ``fluid``: measured points and fitted laws, one row of two panels for each quantity.

Measured points are grey, hollow if they were not fitted. The best law is thick, the others are dashed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.models.characteristics import pick_evenly
from mrdamper.models.fluids.fits import Study
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.small_multiples import Line, Panel, Point, panel_figure
from mrdamper.report.figures.style import SERIES, colour_of_temperature

POINT_COLOUR = "#888888"


def fluid_figure(viscosity: Study | None, yields: Study | None) -> Figure:
    """Return a figure of the measured points and fitted laws of viscosity and yield stress."""
    drawn = []
    if viscosity is not None:
        drawn += [_over_temperature(viscosity, "viscosity, Pa s", 1.0), _residuals(viscosity)]
    if yields is not None:
        drawn += [_over_temperature(yields, "yield stress, kPa", 1e-3), _over_field(yields)]
    figure = panel_figure(drawn, 2, height=2.6)
    if viscosity is not None:
        axes = figure.axes[0]
        axes.set_yscale("log")
        axes.autoscale(axis="y")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
    return figure


def _over_temperature(study: Study, label: str, scale: float) -> Panel:
    """Return a panel of the quantity versus temperature, one curve for each field strength."""
    celsius = study.temperature_K - ZERO_CELSIUS_K
    grid = np.linspace(celsius.min() - 2.0, celsius.max() + 2.0, 200)
    fields = _levels(study.field_A_m[study.used])
    lines = [_points(celsius, scale * study.value, study)]
    for k, fit in enumerate(study.fits[: len(SERIES)]):
        name = f"{fit.name}, {fit.rms_percent:.2g} %"
        for field in fields if k == 0 or fit.field_law is None else ():
            law = scale * fit.value(grid + ZERO_CELSIUS_K, field)
            shown = name if field == fields[0] else ""
            lines.append(Line(grid, law, SERIES[k], shown, 0.9 if k else 1.6, "--" if k else "-"))
    title = "" if len(fields) < 2 else f"{1e-3 * fields[0]:.3g} to {1e-3 * fields[-1]:.3g} kA/m"
    return Panel(title, "temperature, °C", lines, y_label=label)


def _residuals(study: Study) -> Panel:
    """Return a panel with the deviation from the best law, for measured points and for the other laws."""
    celsius, best = study.temperature_K - ZERO_CELSIUS_K, study.best.value(study.temperature_K)
    lines = [_points(celsius, 100.0 * (study.value / best - 1.0), study)]
    for fit, colour in zip(study.fits[1:], SERIES[1:], strict=False):
        deviation = 100.0 * (fit.value(study.temperature_K) / best - 1.0)
        lines.append(Line(celsius[study.used], deviation[study.used], colour, width=0.9, style="--"))
    return Panel("", "temperature, °C", lines, y_label=f"deviation from {study.best.name}, %")


def _over_field(study: Study) -> Panel:
    """Return a panel of the yield stress versus field strength, one curve for each temperature."""
    grid = np.linspace(0.0, 1.04 * float(study.field_A_m.max()), 150)
    levels = _levels(study.temperature_K[study.used] - ZERO_CELSIUS_K)
    lines = [_points(1e-3 * study.field_A_m, 1e-3 * study.value, study)]
    for celsius in levels:
        law = 1e-3 * study.best.value(np.full_like(grid, celsius + ZERO_CELSIUS_K), grid)
        lines.append(Line(1e-3 * grid, law, colour_of_temperature(celsius, levels), f"{celsius:g} °C"))
    return Panel("", "field strength, kA/m", lines, y_label="yield stress, kPa")


def _points(x: FloatArray, y: FloatArray, study: Study) -> Line:
    """Return the measured points of a table."""
    points = [
        Point(at, value, "training" if used else "held_out")
        for at, value, used in zip(x.tolist(), y.tolist(), study.used.tolist(), strict=True)
    ]
    return Line([], [], POINT_COLOUR, points=points)


def _levels(values: FloatArray) -> Sequence[float]:
    """Return at most six distinct values, rounded to three digits."""
    return pick_evenly(sorted({float(f"{value:.3g}") for value in values.tolist()}), 6)
