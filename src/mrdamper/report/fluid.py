"""Result of ``fluid`` as JSON, terminal output, fluid file and figure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Console

from mrdamper.jobs.fluid import FluidResult
from mrdamper.models.fluids.fits import LawFit, Study
from mrdamper.models.fluids.fluid_file import fluid_to_toml
from mrdamper.quantities import to_degC
from mrdamper.report.base import Report, print_notes, text_file
from mrdamper.report.figures.fluid import fluid_figure
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import table_of
from mrdamper.schema import finite_or_none


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
    """Return one table row for each parameter of each law. The best law of each quantity is first."""
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
