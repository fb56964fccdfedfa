"""Figure of ``fluid``: measured points and fitted laws, one row of two panels per quantity.

Measured points are grey, hollow if they were not fitted. The best law is thick, the others are dashed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.models.characteristics import pick_evenly
from mrdamper.models.fluids.fits import Study
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.style import TRAINING, drawing_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINT_COLOUR = "#888888"
OTHER_COLOURS = ("#b08a3c", "#7a5c8e")


def fluid_figure(viscosity: Study | None, yields: Study | None) -> Figure:
    """Return the measured points and laws of the quantities in the tables."""
    rows = int(viscosity is not None) + int(yields is not None)
    with drawing_style():
        figure = Figure(figsize=(9.2, 3.5 * rows), layout="constrained")
        panels = figure.subplots(rows, 2, squeeze=False)
        if viscosity is not None:
            _draw_over_temperature(panels[0, 0], viscosity, "viscosity, Pa s", 1.0)
            panels[0, 0].set_yscale("log")
            _draw_residuals(panels[0, 1], viscosity)
        if yields is not None:
            _draw_over_temperature(panels[-1, 0], yields, "yield stress, kPa", 1e-3)
            _draw_over_field(panels[-1, 1], yields)
    return figure


def _draw_over_temperature(axes: Axes, study: Study, label: str, scale: float) -> None:
    """Draw the quantity versus temperature, one curve for each field."""
    celsius = study.temperature_K - ZERO_CELSIUS_K
    grid = np.linspace(celsius.min() - 2.0, celsius.max() + 2.0, 200)
    fields = _levels(study.field_A_m[study.used])
    for fit, colour in zip(study.fits[1:], OTHER_COLOURS, strict=False):
        for field in fields if fit.field_law is None else ():
            law = scale * fit.value(grid + ZERO_CELSIUS_K, field)
            axes.plot(
                grid, law, "--", color=colour, linewidth=0.9, label=f"{fit.name}, {fit.rms_percent:.2g} %"
            )
    for field in fields:
        law = scale * study.best.value(grid + ZERO_CELSIUS_K, field)
        name = f"{study.best.name}, {study.best.rms_percent:.2g} %" if field == fields[0] else None
        axes.plot(grid, law, color=TRAINING, linewidth=1.6, label=name)
        if field > 0.0:
            axes.annotate(f"{field / 1e3:.3g} kA/m", (grid[0], law[0]), fontsize=6.5)
    _draw_points(axes, celsius, scale * study.value, study)
    axes.set_ylabel(label)
    axes.set_xlabel("temperature, °C")
    axes.legend(loc="best")


def _draw_residuals(axes: Axes, study: Study) -> None:
    """Draw the deviation of the points and of the other laws from the best law."""
    celsius = study.temperature_K - ZERO_CELSIUS_K
    best = study.best.value(study.temperature_K)
    axes.axhline(0.0, color=TRAINING, linewidth=1.2)
    for fit, colour in zip(study.fits[1:], OTHER_COLOURS, strict=False):
        deviation = 100.0 * (fit.value(study.temperature_K) / best - 1.0)
        axes.plot(celsius[study.used], deviation[study.used], "--", color=colour, linewidth=0.9)
    deviation = 100.0 * (study.value / best - 1.0)
    axes.plot(celsius[study.used], deviation[study.used], "o", markersize=3.0, color=POINT_COLOUR)
    axes.set_ylabel(f"deviation from {study.best.name}, %")
    axes.set_xlabel("temperature, °C")


def _draw_over_field(axes: Axes, study: Study) -> None:
    """Draw the yield stress versus field, one curve for each temperature."""
    grid = np.linspace(0.0, 1.04 * float(study.field_A_m.max()), 150)
    for celsius in _levels(study.temperature_K[study.used] - ZERO_CELSIUS_K):
        law = 1e-3 * study.best.value(np.full_like(grid, celsius + ZERO_CELSIUS_K), grid)
        axes.plot(grid / 1e3, law, linewidth=1.1, label=f"{celsius:g} °C")
    _draw_points(axes, study.field_A_m / 1e3, 1e-3 * study.value, study)
    axes.set_ylabel("yield stress, kPa")
    axes.set_xlabel("field strength, kA/m")
    axes.legend(loc="lower right")


def _draw_points(axes: Axes, x: FloatArray, y: FloatArray, study: Study) -> None:
    for chosen, face in ((study.used, POINT_COLOUR), (~study.used, "white")):
        axes.plot(x[chosen], y[chosen], "o", markersize=3.0, color=POINT_COLOUR, markerfacecolor=face)


def _levels(values: FloatArray) -> list[float]:
    """Return the distinct values to three digits, at most six of them."""
    distinct = sorted({float(f"{value:.3g}") for value in values.tolist()})
    return list(pick_evenly(distinct, 6))
