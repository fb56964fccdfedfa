"""What ``heat`` found: the answer's keys, the tables of a terminal, the page, the curve as CSV."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.arrays import FloatArray
from mrdamper.identify.evaluate import finite
from mrdamper.jobs.thermal.heat import HeatResult
from mrdamper.models.card_draws import PROBABILITY
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile, print_notes
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.heat_page import (
    PAGE,
    end_band,
    limit_band,
    limit_rows,
    posterior_words,
    shown_intervals,
    sink_in_words,
)
from mrdamper.runtime.outputs import write_table
from mrdamper.schema import Json, finite_or_none
from mrdamper.thermal.drawing_file import calibrated_text
from mrdamper.thermal.estimation.calibration import CalibratedDrawing
from mrdamper.thermal.estimation.interval import PredictionInterval
from mrdamper.thermal.limits import PART_WORDS
from mrdamper.thermal.temperature_rise import Rise

# ------------------------------------------------------------------------------------------- the answer


def _answer(run: HeatResult) -> Json:
    """Return what ``mrdamper heat --json`` prints, but for the files."""
    rise, drawing, card = run.rise, run.drawing, run.card
    field = run.field
    return {
        "duty": run.duty.text,
        "model": rise.model,
        **_course(rise, run.prediction_interval),
        "limit_degC": rise.limit_K - ZERO_CELSIUS_K,
        "ripple_K": finite(rise.ripple_K),
        "correlations": dict(rise.correlations),
        "tempered": card.damper.temperature_dependent,
        "assumed": list(card.damper.assumed),
        "sink": None if drawing.sink is None else sink_in_words(drawing.sink),
        "without_sink": None
        if run.bare is None or run.bare_prediction_interval is None
        else _course(run.bare, run.bare_prediction_interval),
        "calibration": None if run.calibrated is None else _calibration(run.calibrated),
        "finite_element": None
        if field is None
        else {
            "time_s": field.end.time,
            "fluid_degC": field.fluid - ZERO_CELSIUS_K,
            "coil_degC": field.coil - ZERO_CELSIUS_K,
            "wall_degC": field.wall - ZERO_CELSIUS_K,
            "nodes": len(field.model.nodes),
            "energy_closure": field.closure,
        },
        "posterior": _posterior(run),
        "extrapolated": run.extrapolated,
        "notes": list(run.notes),
    }


def _posterior(run: HeatResult) -> Json | None:
    """Return the intervals that the card's posterior draws leave, of temperatures and times to limits."""
    found = run.posterior
    if found is None:
        return None
    return {
        "probability": PROBABILITY,
        "dampers": found.dampers,
        "time_s": run.rise.time.tolist(),
        "low_degC": (found.low - ZERO_CELSIUS_K).tolist(),
        "high_degC": (found.high - ZERO_CELSIUS_K).tolist(),
        "limits": [
            {
                "part": each.limit.name,
                "interval_s": [finite_or_none(to_limit.low_s), finite_or_none(to_limit.high_s)],
            }
            for each, to_limit in zip(run.rise.limits, found.to_limits, strict=True)
        ],
    }


def _calibration(calibrated: CalibratedDrawing) -> Json:
    curve = calibrated.curve
    return {
        "curve": curve.name,
        "place": curve.place,
        "from_s": float(curve.time[0]),
        "to_s": float(curve.time[-1]),
        "heat_capacity": calibrated.heat_capacity,
        "heat_capacity_error": calibrated.heat_capacity_error,
        "film": calibrated.film,
        "film_error": calibrated.film_error,
        "correlation": calibrated.correlation,
        "start_degC": calibrated.start_K - ZERO_CELSIUS_K,
        "residual_K": calibrated.residual_K,
        "noise_K": curve.noise_K,
        "entries": {table: dict(entries) for table, entries in calibrated.entries.items()},
        "words": list(calibrated.notes),
    }


def _course(rise: Rise, prediction_interval: PredictionInterval) -> Json:
    to_limit = prediction_interval.to_limit
    return {
        "curve": {
            "time_s": rise.time.tolist(),
            "fluid_degC": rise.fluid_degC.tolist(),
            "coil_degC": rise.coil_degC.tolist(),
            "wall_degC": rise.wall_degC.tolist(),
        },
        "hot_degC": {name: (rise.hot[part] - ZERO_CELSIUS_K).tolist() for part, name in PART_WORDS.items()},
        "limits": limit_rows(rise, prediction_interval),
        "energy_closure": rise.energy_closure,
        "time_to_limit_s": rise.time_to_limit_s,
        "time_to_limit_interval_s": [
            finite_or_none(to_limit.low_s),
            finite_or_none(to_limit.high_s),
        ],
        "interval": {
            "probability": prediction_interval.probability,
            "time_s": prediction_interval.time.tolist(),
            "median_degC": (prediction_interval.median - ZERO_CELSIUS_K).tolist(),
            "low_degC": (prediction_interval.low - ZERO_CELSIUS_K).tolist(),
            "high_degC": (prediction_interval.high - ZERO_CELSIUS_K).tolist(),
        },
        "force_loss_percent": rise.force_loss_percent,
        "peak_force_N": [finite(force) for force in rise.peak_force_N.tolist()],
        "power_W": {"mechanical": rise.mechanical_W.tolist(), "coil": rise.coil_W.tolist()},
        "paths_W": {path: watts.tolist() for path, watts in rise.paths_W.items()},
        "energy_J": dict(rise.energy_J),
    }


def _rows(run: HeatResult) -> list[dict[str, object]]:
    """Return the curve as a table, one row for each time."""
    rise = run.rise
    columns: dict[str, FloatArray] = {
        "time_s": rise.time,
        "fluid_degC": rise.fluid_degC,
        "coil_degC": rise.coil_degC,
        "wall_degC": rise.wall_degC,
        **{f"hottest_{name}_degC": rise.hot[part] - ZERO_CELSIUS_K for part, name in PART_WORDS.items()},
        "peak_force_N": rise.peak_force_N,
        "mechanical_W": rise.mechanical_W,
        "coil_W": rise.coil_W,
        **{f"{path.replace(' ', '_')}_W": watts for path, watts in rise.paths_W.items()},
    }
    return [
        {name: None if np.isnan(values[k]) else float(f"{values[k]:.9g}") for name, values in columns.items()}
        for k in range(len(rise.time))
    ]


# --------------------------------------------------------------------------------------------- the terminal


def summary(run: HeatResult) -> list[str]:
    """Return when the limit is reached, how hot the fluid gets, and what force that costs."""
    rise, interval = run.rise, next(iter(shown_intervals(run)), None)
    return [*_limit_words(rise, interval), _end_words(rise, interval)]


def show(run: HeatResult, console: Console) -> None:
    """Print temperatures over time, where the heat went, and what a reader should know."""
    for (title, rise), interval in zip_longest(run.rises, shown_intervals(run)):
        console.print(_table(rise, _title(run, title)))
        for line in _words(rise, interval):
            console.print(line)
    if run.calibrated is not None:
        for line in _calibration_words(run.calibrated):
            console.print(escape(line))
    for line in posterior_words(run):
        console.print(line)
    print_notes(run.notes, console)
    laws = "; ".join(f"{surface}: {law}" for surface, law in run.rise.correlations.items())
    console.print(escape(f"film coefficients: {laws}"))


def _title(run: HeatResult, title: str) -> str:
    sink = run.drawing.sink
    if title != "with heat sink":
        return "no heat sink" if run.bare is None else title
    return title if sink is None else sink_in_words(sink)


def _table(rise: Rise, title: str) -> Table:
    parts = (rise.fluid, rise.hot["gap"], rise.coil, rise.hot["coil"], rise.wall)
    shown = (int(np.argmin(np.abs(rise.time - at * rise.time[-1] / 6))) for at in range(7))
    rows = []
    for k in dict.fromkeys(shown):
        force = rise.peak_force_N[k]
        cells = (
            f"{rise.time[k] / 60:.1f}",
            *(f"{kelvin[k] - ZERO_CELSIUS_K:.1f}" for kelvin in parts),
            f"{force:.0f}" if math.isfinite(force) else "-",
            f"{rise.mechanical_W[k] + rise.coil_W[k]:.1f}",
            f"{sum(watts[k] for watts in rise.paths_W.values()):.1f}",
        )
        rows.append(cells)
    places = ("fluid degC", "hottest", "coil degC", "hottest", "wall degC")
    return terminal_table(title, ("minutes", *places, "peak force N", "W in", "W out"), rows)


def _end_words(rise: Rise, interval: PredictionInterval | None) -> str:
    """Return how hot the fluid is at the end: as an interval, where there is one."""
    band = end_band(rise, interval, "degC")
    after = f"fluid after {rise.time[-1] / 60:.4g} min"
    return f"{after}: {band}" if band else f"{after}: {rise.fluid_degC[-1]:.1f} degC, extrapolated"


def _limit_words(rise: Rise, interval: PredictionInterval | None) -> Iterator[str]:
    for k, each in enumerate(rise.limits):
        when = "not reached" if each.time_s is None else f"reached after {each.time_s / 60:.1f} min"
        band = limit_band(interval, k)
        hottest = f"hottest point {each.hottest - ZERO_CELSIUS_K:.1f} degC"
        limit = f"limit of the {each.limit.name}, {each.limit.celsius:.4g} degC {each.limit.source}"
        yield f"{limit}: {when}{f' ({band})' if band else ''}; {hottest}"
    if rise.force_loss_percent is not None:
        yield f"the peak force has lost {rise.force_loss_percent:.1f} % of what it is at 20 degC"


def _words(rise: Rise, interval: PredictionInterval | None) -> list[str]:
    """Return the lines below a table of temperatures: limit, force, where the heat went; with intervals."""
    energy = rise.energy_J
    total = energy["mechanical"] + energy["coil"]
    parts = [name for name in energy if name not in {"mechanical", "coil", "out"}]
    shares = ", ".join(f"{name} {100 * energy[name] / total:.0f} %" for name in parts) if total > 0 else "-"
    return [
        *_limit_words(rise, interval),
        _end_words(rise, interval),
        f"of {total / 1e3:.1f} kJ: {shares} (account closes to {rise.energy_closure:.0e})",
    ]


def _calibration_words(calibrated: CalibratedDrawing) -> list[str]:
    """Return the two factors, their errors and the residual."""
    curve = calibrated.curve
    lines = [
        f"calibrated by {curve.name} ({curve.place}, {curve.time[0] / 60:.4g} to "
        f"{curve.time[-1] / 60:.4g} min):",
        f"  heat capacity x {calibrated.heat_capacity:.4g} +- {calibrated.heat_capacity_error:.1g}",
        f"  convection x {calibrated.film:.4g} +- {calibrated.film_error:.1g}; "
        f"correlation {calibrated.correlation:.2f}",
        f"  residual {calibrated.residual_K:.2g} K, noise of the thermometer {curve.noise_K:.2g} K",
    ]
    return [*lines, *(f"  {note}" for note in calibrated.notes)]


# ----------------------------------------------------------------------------------------------- the files


def _write_calibrated(run: HeatResult, path: Path) -> None:
    """Write the drawing that follows what was measured, as the file that it came from."""
    found, drawing = run.calibrated, run.drawing
    assert found is not None
    title = f"{drawing.name}, calibrated by {found.curve.name}"
    path.write_text(calibrated_text(drawing.text, found.entries, title, sink=drawing.sink), encoding="utf-8")


REPORT = Report(
    answer=_answer,
    show=show,
    summary=summary,
    page=PAGE,
    files=(
        WrittenFile(name="heat.json", key="file"),
        WrittenFile(name="heat.csv", write=lambda run, path: write_table(path, _rows(run))),
        WrittenFile(
            name="calibrated.toml",
            key="drawing",
            write=_write_calibrated,
            when=lambda run: bool(run.drawing.text) and run.calibrated is not None,
        ),
    ),
    rows=_rows,
)
