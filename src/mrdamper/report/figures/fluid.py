"""The picture of ``mrdamper fluid``: measured points, fitted laws, what is left over, as one SVG.

Measured points are grey, the chosen law thick, other laws thin and dashed; points that no law was fitted to
are hollow. Temperatures are in degC, fields in kA/m.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.models.fluids.rheometer import BoolArray
from mrdamper.models.fluids.viscosity_fit import ViscosityStudy
from mrdamper.models.fluids.yield_fit import YieldStudy
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.style import HELD_OUT, TRAINING, drawing_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINT = "#888888"
_OTHER = ("#b08a3c", "#7a5c8e")
_NAMES = {
    "arrhenius": "Arrhenius",
    "reynolds": "Reynolds",
    "vft": "VFT",
    "carlson": "Carlson's field scale",
    "carlson-free-scale": "fitted field scale",
}
_MOST_CURVES = 8


def fluid_figure(viscosity: ViscosityStudy | None, yields: YieldStudy | None) -> Figure:
    """Return what the tables hold, two panels for each quantity."""
    rows = int(viscosity is not None) + int(yields is not None)
    with drawing_style():
        figure = Figure(figsize=(9.2, 3.5 * rows))
        grid = figure.add_gridspec(rows, 2, width_ratios=(1.0, 1.0))
        row = 0
        if viscosity is not None:
            _draw_viscosity(figure.add_subplot(grid[row, 0]), viscosity)
            _draw_residual(figure.add_subplot(grid[row, 1]), viscosity)
            row += 1
        if yields is not None:
            _draw_over_field(figure.add_subplot(grid[row, 0]), yields)
            _draw_over_temperature(figure.add_subplot(grid[row, 1]), yields)
        height = 3.5 * rows
        figure.subplots_adjust(left=0.06, right=0.985, wspace=0.14, hspace=0.26)
        figure.subplots_adjust(top=1.0 - 0.28 / height, bottom=0.42 / height)
    return figure


def _draw_viscosity(axes: Axes, study: ViscosityStudy) -> None:
    """Draw points and laws; points that would squeeze the picture are marked at its lower edge."""
    kelvin, viscosity, used = study.temperature_K, study.viscosity_Pa_s, study.used
    celsius = kelvin - ZERO_CELSIUS_K
    smallest, high = float(viscosity[used].min()), 1.3 * float(viscosity[used].max())
    low = max(0.4 * smallest, min(float(viscosity.min()), smallest) / 1.3)
    grid = np.linspace(kelvin.min() - 2.0, kelvin.max() + 2.0, 200)
    for fit, colour in zip(study.fits[1:], _OTHER, strict=False):
        label = f"{_NAMES[fit.factor.kind]}, rms {fit.rms_percent:.2g} %"
        axes.plot(
            grid - ZERO_CELSIUS_K,
            fit.value(grid),
            linestyle=(0, (4, 2)),
            color=colour,
            linewidth=0.9,
            label=label,
        )
    best = study.best
    label = f"{_NAMES[best.factor.kind]}, rms {best.rms_percent:.2g} %"
    axes.plot(grid - ZERO_CELSIUS_K, best.value(grid), color=TRAINING, linewidth=1.6, label=label)
    axes.plot(celsius[used], viscosity[used], "o", markersize=3.0, color=_POINT, zorder=2.5, label="measured")
    if not used.all():
        shown, below = ~used & (viscosity > 1.1 * low), ~used & (viscosity <= 1.1 * low)
        edge = np.full(viscosity.size, 1.08 * low)
        for chosen, y, marker, word in ((shown, viscosity, "o", "left out"), (below, edge, "v", "")):
            axes.plot(
                celsius[chosen],
                y[chosen],
                marker,
                markersize=3.6,
                color=HELD_OUT,
                markerfacecolor="white",
                zorder=2.5,
                label=word or None,
            )
        hot = max(130.0, celsius.max() + 2.0)
        axes.axvspan(130.0, hot, color="#f6ece9", linewidth=0, zorder=0)
    axes.set_yscale("log")
    _label_decades(axes, low, max(high, 1.3 * float(viscosity.max())))
    axes.set_title("Viscosity without field, Pa s", loc="left", pad=4)
    axes.set_xlabel("temperature, °C", labelpad=1.5)
    axes.legend(loc="best")


def _draw_residual(axes: Axes, study: ViscosityStudy) -> None:
    """Draw what the law leaves over (a bend is what it cannot follow), and how the others differ from it."""
    kelvin = study.temperature_K[study.used]
    grid = np.linspace(kelvin[0], kelvin[-1], 100)
    axes.axhline(0.0, color=TRAINING, linewidth=1.2)
    for fit, colour in zip(study.fits[1:], _OTHER, strict=False):
        apart = 100.0 * np.log(fit.value(grid) / study.best.value(grid))
        axes.plot(grid - ZERO_CELSIUS_K, apart, linestyle=(0, (4, 2)), color=colour, linewidth=0.9)
    axes.plot(
        kelvin - ZERO_CELSIUS_K, 100.0 * study.best.residual, "o", markersize=3.0, color=_POINT, zorder=2.5
    )
    axes.set_title(f"Against {_NAMES[study.best.factor.kind]}, %", loc="left", pad=4)
    axes.set_xlabel("temperature, °C", labelpad=1.5)


def _draw_over_field(axes: Axes, study: YieldStudy) -> None:
    """Draw the yield stress over the field, a curve for each temperature."""
    celsius = study.temperature_K - ZERO_CELSIUS_K
    groups = _groups(celsius, 5.0)
    grid = np.linspace(0.0, 1.04 * float(study.field_A_m.max()), 150)
    for share, (at, members) in zip(_shares(len(groups)), groups, strict=True):
        colour = to_hex(mpl.colormaps["plasma"](0.85 * share))
        _points(axes, study.field_A_m / 1e3, study, members, colour)
        law = study.best.value(grid, np.full_like(grid, at + ZERO_CELSIUS_K))
        axes.plot(grid / 1e3, law / 1e3, color=colour, linewidth=1.1, label=f"{at:.4g} °C")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    best = study.best
    title = f"Yield stress over field, kPa: {_NAMES[best.name]}, rms {best.rms_percent:.2g} %"
    axes.set_title(title, loc="left", pad=4)
    axes.set_xlabel("field strength, kA/m", labelpad=1.5)
    axes.legend(loc="lower right")


def _draw_over_temperature(axes: Axes, study: YieldStudy) -> None:
    """Draw the yield stress over temperature, a line for each field."""
    celsius = study.temperature_K - ZERO_CELSIUS_K
    groups = _groups(study.field_A_m, 0.01 * float(study.field_A_m.max()))
    grid = np.linspace(celsius.min() - 2.0, celsius.max() + 2.0, 50)
    for share, (at, members) in zip(_shares(len(groups)), groups, strict=True):
        if not at > 0.0:
            continue
        colour = to_hex(mpl.colormaps["viridis"](0.08 + 0.70 * share))
        _points(axes, celsius, study, members, colour)
        law = study.best.value(np.full_like(grid, at), grid + ZERO_CELSIUS_K) / 1e3
        axes.plot(grid, law, color=colour, linewidth=1.1)
        axes.annotate(
            f"{at / 1e3:.3g} kA/m",
            (grid[-1], law[-1]),
            (3, 0),
            textcoords="offset points",
            va="center",
            fontsize=6.5,
            color=colour,
        )
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(right=grid[-1] + 0.14 * (grid[-1] - grid[0]))  # room for the labels
    axes.set_title("Yield stress over temperature, kPa", loc="left", pad=4)
    axes.set_xlabel("temperature, °C", labelpad=1.5)


def _points(axes: Axes, x: FloatArray, study: YieldStudy, members: BoolArray, colour: str) -> None:
    for chosen, face in ((members & study.used, colour), (members & ~study.used, "white")):
        axes.plot(
            x[chosen], study.stress_Pa[chosen] / 1e3, "o", markersize=3.2, color=colour, markerfacecolor=face
        )


def _groups(values: FloatArray, width: float) -> list[tuple[float, BoolArray]]:
    """Return (mean, members) of values that lie together, at most so many of them, evenly chosen."""
    order = np.sort(values)
    cuts = order[1:][np.diff(order) > width]
    number = np.searchsorted(cuts, values, side="right")
    found = [(float(values[number == k].mean()), number == k) for k in range(len(cuts) + 1)]
    chosen = np.unique(np.linspace(0, len(found) - 1, min(len(found), _MOST_CURVES)).round().astype(int))
    return [found[k] for k in chosen]


def _shares(count: int) -> Sequence[float]:
    return [k / max(count - 1, 1) for k in range(count)]


def _label_decades(axes: Axes, low: float, high: float) -> None:
    """Label a logarithmic axis with plain numbers, closely where it spans little."""
    axes.set_ylim(low, high)
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    steps = (1, 1.5, 2, 3, 4, 5, 7) if high / low < 8.0 else (1, 2, 5)
    ticks = [m * 10.0**d for d in decades for m in steps if low <= m * 10.0**d <= high]
    axes.yaxis.set_ticks(ticks, [f"{tick:.3g}" for tick in ticks])
    axes.yaxis.set_ticks([], minor=True)
