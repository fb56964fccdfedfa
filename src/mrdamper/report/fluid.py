"""What ``fluid`` found: the answer's keys, the laws on a terminal, the fluid's file and its picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from mrdamper.identify.evaluate import finite
from mrdamper.jobs.fluid import FluidResult
from mrdamper.models.fluids.carlson import saturation_stress
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.models.fluids.fluid_file import fluid_to_toml
from mrdamper.models.fluids.viscosity_fit import ViscosityFit, ViscosityStudy
from mrdamper.models.fluids.yield_fit import YieldFit, YieldStudy
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import (
    FirstScreen,
    Page,
    Report,
    Tile,
    WrittenFile,
    picture_file,
    print_notes,
    table_of,
)
from mrdamper.report.figures.fluid import fluid_figure
from mrdamper.report.sections import terminal_table
from mrdamper.schema import Json

_Fit = ViscosityFit | YieldFit


def _answer(found: FluidResult) -> Json:
    return {
        "fluid": found.fluid.name,
        "viscosity": None if found.viscosity is None else _viscosity(found.viscosity),
        "yield_stress": None if found.yield_stress is None else _yield(found.yield_stress, found.fluid),
        "like": found.like.name,
        "valid_degC": _celsius(found.fluid.valid_K),
        "notes": list(found.notes),
        "file": None,
        "picture": None,
    }


def _viscosity(study: ViscosityStudy) -> Json:
    best, used = study.best, study.used
    kelvin, measured = study.temperature_K, study.viscosity_Pa_s
    left_out = zip(kelvin[~used], measured[~used], best.value(kelvin[~used]), strict=True)
    return {
        **_law(best),
        "points": int(np.count_nonzero(used)),
        "temperature_degC": _celsius((kelvin[used][0], kelvin[used][-1])),
        "left_out": [
            {
                "temperature_degC": round(float(at) - ZERO_CELSIUS_K, 6),
                "viscosity_Pa_s": float(value),
                "law_Pa_s": finite(law),
            }
            for at, value, law in left_out
        ],
        "laws": [_law(fit) for fit in study.fits],
    }


def _yield(study: YieldStudy, made: Fluid) -> Json:
    best = study.best
    kelvin = study.temperature_K[study.used]
    field = study.field_A_m[study.used]
    return {
        **_law(best),
        "points": int(np.count_nonzero(study.used)),
        "temperature_degC": _celsius((float(kelvin.min()), float(kelvin.max()))),
        "field_A_m": [float(field.min()), float(field.max())],
        "particle_fraction": made.particle_fraction,
        "carrier_constant": best.field_law.saturation_Pa / saturation_stress(made.particle_fraction),
        "laws": [_law(fit) for fit in study.fits],
    }


def _law(fit: _Fit) -> Json:
    fall, error = fit.fall_percent()
    return {
        "law": _name(fit),
        "numbers": {
            number.name: {
                "value": number.value,
                "unit": number.unit,
                "standard_error": finite(number.standard_error),
            }
            for number in fit.parameters
        },
        "rms_percent": fit.rms_percent,
        "aicc": finite(fit.aicc),
        "fall_20_to_100_degC_percent": finite(fall),
        "fall_standard_error_percent": finite(error),
        "limit": fit.limit or None,
    }


def _name(fit: _Fit) -> str:
    return fit.name if isinstance(fit, YieldFit) else fit.factor.kind


def _celsius(ends_K: tuple[float, float]) -> list[float]:
    return [round(float(end) - ZERO_CELSIUS_K, 6) for end in ends_K]


# ------------------------------------------------------------------------------------------- a terminal


def _studies(found: FluidResult) -> Iterator[tuple[str, ViscosityStudy | YieldStudy]]:
    if found.viscosity is not None:
        yield "Viscosity without field", found.viscosity
    if found.yield_stress is not None:
        yield "Yield stress", found.yield_stress


def _show(found: FluidResult, console: Console) -> None:
    """Print the laws of a fluid, the chosen ones first, with their numbers, and what a reader should know."""
    for title, study in _studies(found):
        kelvin = study.temperature_K[study.used]
        low, high = _celsius((float(kelvin.min()), float(kelvin.max())))
        points = f"{kelvin.size} points at {low:.4g} to {high:.4g} degC"
        console.print(_laws(study.fits, f"{title}: {points}; the first law is taken"))
        console.print(f"[bold]{title.lower()}[/bold] {_fall(study.best)}")
        for fit in study.fits:
            if fit.limit:
                console.print(f"- {_name(fit)}: {fit.limit}")
    print_notes(found.notes, console)


def _fall(fit: _Fit) -> str:
    fall, error = fit.fall_percent()
    spread = f" ± {error:.2g}" if np.isfinite(error) else ""
    return f"falls by {fall:.1f}{spread} % from 20 to 100 degC"


def _laws(fits: Sequence[_Fit], title: str) -> Table:
    rows: list[tuple[str, ...] | None] = []
    for fit in fits:
        judged = (fit.aicc, fit.fall_percent()[0])
        cells = (f"{fit.rms_percent:.2g}", *(f"{v:.1f}" if np.isfinite(v) else "-" for v in judged))
        for row, number in enumerate(fit.parameters):
            error = number.standard_error
            known = f"{error:.2g}" if np.isfinite(error) else "-"
            name, told = ("", ("", "", "")) if row else (_name(fit), cells)
            rows.append((name, number.name, f"{number.value:.5g}", known, number.unit, *told))
        rows.append(None)
    names = ("law", "number", "value", "± standard error", "unit", "rms %", "AICc", "fall %")
    return terminal_table(title, names, rows, left=("law", "number", "unit"), whole=True)


def _figure(found: FluidResult) -> Figure:
    return fluid_figure(found.viscosity, found.yield_stress)


def _first(found: FluidResult) -> FirstScreen:
    tiles = []
    for title, study in _studies(found):
        fall, error = study.best.fall_percent()
        band = f"± {error:.2g} % (standard error)" if np.isfinite(error) else ""
        tiles.append(Tile(f"{fall:.1f} %", f"{title.lower()}: fall from 20 to 100 °C", band))
    for title, study in _studies(found):
        points = f"{np.count_nonzero(study.used)} points, law {_name(study.best)}"
        tiles.append(
            Tile(f"{study.best.rms_percent:.2g} %", f"{title.lower()}: RMS residual of the law", points)
        )
    low, high = _celsius(found.fluid.valid_K)
    tiles.append(Tile(f"{low:g} to {high:g} °C", "valid", f"the rest as {found.like.name}"))
    return FirstScreen(
        title=f"The fluid {found.fluid.name}",
        subject=f"Laws fitted to rheometer tables; the rest as {found.like.name}.",
        verdict="; ".join(
            f"{title.lower()} {_fall(study.best).replace('degC', '°C')}" for title, study in _studies(found)
        ),
        tiles=(tiles[0], tiles[1], tiles[2]),
        caption="Points: measured; thick: the law that is taken; hollow points were left out of the fit",
        notes=found.notes,
    )


def _rows(found: FluidResult) -> list[dict[str, object]]:
    """Return one row for each number of each law."""
    return [
        {
            "quantity": title.lower(),
            "law": _name(fit),
            "number": number.name,
            "value": number.value,
            "standard_error": finite(number.standard_error),
            "unit": number.unit,
        }
        for title, study in _studies(found)
        for fit in study.fits
        for number in fit.parameters
    ]


REPORT = Report(
    answer=_answer,
    show=_show,
    page=Page(
        name="fluid.html",
        first=_first,
        picture=_figure,
        label="Laws of the fluid",
        sections=lambda found: table_of(_rows(found)),
    ),
    files=(
        WrittenFile(
            name="fluid.toml",
            key="file",
            write=lambda found, path: path.write_text(fluid_to_toml(found.fluid), encoding="utf-8"),
        ),
        picture_file("fluid.svg", _figure, "Laws of the fluid"),
    ),
    rows=_rows,
)
