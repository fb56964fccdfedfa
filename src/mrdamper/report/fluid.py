"""Output of the command ``fluid``: fluid file and page on fitted fluid properties.

A law is a formula for viscosity or yield stress. The figure has one row of two panels for each of these
quantities. Measured points are grey, and hollow if they were excluded from the fit. The curve of the best law
is thick. The curves of all other laws are dashed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.arrays import FloatArray
from mrdamper.jobs.fluid import FluidResult
from mrdamper.models.characteristics import pick_evenly
from mrdamper.models.fluids.fits import LawFit, Study
from mrdamper.models.fluids.fluid_file import fluid_to_toml
from mrdamper.quantities import ZERO_CELSIUS_K, to_degC
from mrdamper.report.base import Report, print_notes, text_file
from mrdamper.report.figures.small_multiples import Line, Panel, Point, panel_figure
from mrdamper.report.figures.style import SERIES, colour_of_temperature
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import table_of
from mrdamper.schema import finite_or_none

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
    """Return a panel of viscosity or yield stress versus temperature, with all laws."""
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
    """Return a panel of measured points and laws as deviation from the best law [%]."""
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
    """Return the measured points of a rheometer table for a plot."""
    points = [
        Point(at, value, "training" if used else "held_out")
        for at, value, used in zip(x.tolist(), y.tolist(), study.used.tolist(), strict=True)
    ]
    return Line([], [], POINT_COLOUR, points=points)


def _levels(values: FloatArray) -> Sequence[float]:
    """Return at most six of the different values, rounded to three digits."""
    return pick_evenly(sorted({float(f"{value:.3g}") for value in values.tolist()}), 6)


def _fields(result: FluidResult) -> dict[str, object]:
    return {
        "fluid": result.fluid.name,
        "viscosity": None if result.viscosity is None else _study(result.viscosity),
        "yield_stress": None if result.yield_stress is None else _study(result.yield_stress),
        "particle_fraction": result.fluid.particle_fraction,
        "like": result.like.name,
        "valid_degC": [to_degC(end) for end in result.fluid.valid_K],
        "notes": result.notes,
        "file": None,
    }


def _study(study: Study) -> dict[str, object]:
    kelvin = study.temperature_K[study.used]
    return {
        **_law(study.best),
        "points": int(np.count_nonzero(study.used)),
        "temperature_degC": [to_degC(float(kelvin.min())), to_degC(float(kelvin.max()))],
        "laws": [_law(fit) for fit in study.fits],
    }


def _law(fit: LawFit) -> dict[str, object]:
    return {
        "law": fit.name,
        "numbers": {each.name: each for each in fit.parameters},
        "rms_percent": fit.rms_percent,
        "aicc": fit.aicc,
        "fall_20_to_100_degC_percent": fit.fall_percent,
        "fall_standard_error_percent": fit.fall_standard_error_percent,
    }


def _studies(result: FluidResult) -> Iterator[tuple[str, Study]]:
    if result.viscosity is not None:
        yield "viscosity", result.viscosity
    if result.yield_stress is not None:
        yield "yield stress", result.yield_stress


def _fall(quantity: str, fit: LawFit) -> str:
    error = fit.fall_standard_error_percent
    band = f" ± {error:.2g}" if np.isfinite(error) else ""
    return f"{quantity} falls by {fit.fall_percent:.1f}{band} % from 20 to 100 degC"


def _rows(result: FluidResult) -> list[dict[str, object]]:
    """Return one table row for each parameter of each fitted law, the best laws first."""
    return [
        {
            "quantity": quantity,
            "law": fit.name,
            "number": each.name,
            "value": each.value,
            "standard_error": finite_or_none(each.standard_error),
            "unit": each.unit,
            "rms_percent": fit.rms_percent,
        }
        for quantity, study in _studies(result)
        for fit in study.fits
        for each in fit.parameters
    ]


def _show(result: FluidResult, console: Console) -> None:
    for table in table_of(_rows(result), "Laws, the best one of each quantity first"):
        console.print(table.printed(whole=True))
    for quantity, study in _studies(result):
        console.print(f"{_fall(quantity, study.best)} ({np.count_nonzero(study.used)} points)")
    print_notes(result.notes, console)


def _first(result: FluidResult) -> FirstScreen:
    studies = list(_studies(result))
    falls = [
        Tile(f"{study.best.fall_percent:.1f} %", f"{quantity}: decrease from 20 to 100 °C")
        for quantity, study in studies
    ]
    residuals = [
        Tile(f"{study.best.rms_percent:.2g} %", f"{quantity}: RMS residual", f"law {study.best.name}")
        for quantity, study in studies
    ]
    low, high = map(to_degC, result.fluid.valid_K)
    valid = Tile(f"{low:g} to {high:g} °C", "valid range", f"other properties from {result.like.name}")
    tiles = [*falls, *residuals, valid]
    return FirstScreen(
        title=f"The fluid {result.fluid.name}",
        subject=f"Laws fitted to rheometer tables. Other properties are those of {result.like.name}.",
        verdict="; ".join(_fall(quantity, study.best).replace("degC", "°C") for quantity, study in studies),
        tiles=(tiles[0], tiles[1], tiles[2]),
        caption="Points are measured, hollow points are not used. The thick line is the best law, dashed "
        "lines are the other laws",
        notes=result.notes,
    )


REPORT = Report(
    fields=_fields,
    show=_show,
    page=Page(
        name="fluid.html",
        first=_first,
        picture=lambda result: fluid_figure(result.viscosity, result.yield_stress),
        label="Laws of the fluid",
        sections=lambda result: table_of(_rows(result)),
    ),
    files=(text_file("fluid.toml", lambda result: fluid_to_toml(result.fluid), key="file"),),
    rows=_rows,
)
