"""Output of the command ``heat``: JSON, terminal, page, CSV file of temperatures."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.arrays import FloatArray
from mrdamper.jobs.thermal.heat import HeatResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile, csv_file, print_notes, text_file
from mrdamper.report.sections import print_compact, terminal_table
from mrdamper.report.thermal.heat_page import (
    PAGE,
    end_band,
    limit_band,
    limit_rows,
    page_intervals,
    sink_in_words,
)
from mrdamper.thermal.drawing_file import calibrated_text
from mrdamper.thermal.estimation.calibration import CalibratedDrawing
from mrdamper.thermal.estimation.interval import PredictionInterval
from mrdamper.thermal.limits import PART_WORDS
from mrdamper.thermal.temperature_rise import Rise


def _fields(run: HeatResult) -> dict[str, object]:
    """Return the values that ``mrdamper heat --json`` prints, without the paths of the files."""
    rise, drawing, damper = run.rise, run.drawing, run.card.damper
    return {
        "duty": run.duty.text,
        "model": rise.model,
        **_course(rise, run.prediction_interval),
        "limit_degC": rise.limit_K - ZERO_CELSIUS_K,
        "correlations": rise.correlations,
        "tempered": damper.temperature_dependent,
        "assumed": damper.assumed,
        "sink": None if drawing.sink is None else sink_in_words(drawing.sink),
        "without_sink": None
        if run.bare is None or run.bare_prediction_interval is None
        else _course(run.bare, run.bare_prediction_interval),
        "calibration": None if run.calibrated is None else _calibration(run.calibrated),
        "extrapolated": run.extrapolated,
        "notes": run.notes,
    }


def _calibration(calibrated: CalibratedDrawing) -> dict[str, object]:
    curve = calibrated.curve
    return {
        "curve": curve.name,
        "place": curve.place,
        "from_s": curve.time[0],
        "to_s": curve.time[-1],
        "heat_capacity": calibrated.heat_capacity,
        "heat_capacity_error": calibrated.heat_capacity_error,
        "film": calibrated.film,
        "film_error": calibrated.film_error,
        "correlation": calibrated.correlation,
        "start_degC": calibrated.start_K - ZERO_CELSIUS_K,
        "residual_K": calibrated.residual_K,
        "noise_K": curve.noise_K,
        "entries": calibrated.entries,
        "words": calibrated.notes,
    }


def _course(rise: Rise, interval: PredictionInterval) -> dict[str, object]:
    return {
        "curve": {"time_s": rise.time, **_means(rise)},
        "hot_degC": {name: rise.hot[part] - ZERO_CELSIUS_K for part, name in PART_WORDS.items()},
        "limits": limit_rows(rise, interval),
        "energy_closure": rise.energy_closure,
        "time_to_limit_s": rise.time_to_limit_s,
        "time_to_limit_interval_s": [interval.to_limit.low_s, interval.to_limit.high_s],
        "interval": {
            "probability": interval.probability,
            "time_s": interval.time,
            "median_degC": interval.median - ZERO_CELSIUS_K,
            "low_degC": interval.low - ZERO_CELSIUS_K,
            "high_degC": interval.high - ZERO_CELSIUS_K,
        },
        "force_loss_percent": rise.force_loss_percent,
        "peak_force_N": rise.peak_force_N,
        "power_W": {"mechanical": rise.mechanical_W, "coil": rise.coil_W},
        "paths_W": rise.paths_W,
        "energy_J": rise.energy_J,
    }


def _means(rise: Rise) -> dict[str, FloatArray]:
    return {"fluid_degC": rise.fluid_degC, "coil_degC": rise.coil_degC, "wall_degC": rise.wall_degC}


def _rows(run: HeatResult) -> list[dict[str, object]]:
    """Return the temperature curve as table rows, one row for each time."""
    rise = run.rise
    columns: dict[str, FloatArray] = {
        "time_s": rise.time,
        **_means(rise),
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


def summary(run: HeatResult) -> list[str]:
    """Return lines on temperature limits, final fluid temperature, and loss of force."""
    intervals = page_intervals(run)
    return _sentences(run.rise, intervals[0] if intervals else None)


def show(run: HeatResult, console: Console) -> None:
    """Print the summary, the energies, temperatures at seven times, and notes."""
    intervals = page_intervals(run)
    lines = summary(run)
    if run.bare is not None:
        bare_interval = intervals[1] if len(intervals) > 1 else None
        index = run.bare.limits.index(run.bare.first_limit)
        sentence = _limit_sentence(run.bare, bare_interval, index)
        lines.append(f"Without heat sink: l{sentence[1:]}")
    for line in (*lines, _energy_sentence(run.rise)):
        console.print(escape(line))
    print_compact(_table(run.rise), console)
    if run.calibrated is not None:
        for line in _calibration_words(run.calibrated):
            console.print(escape(line))
    print_notes(run.notes, console)


def _table(rise: Rise) -> Table:
    parts = (rise.fluid, rise.hot["gap"], rise.coil, rise.hot["coil"], rise.wall)
    steps = (int(np.argmin(np.abs(rise.time - sixth * rise.time[-1] / 6))) for sixth in range(7))
    rows = []
    for k in dict.fromkeys(steps):
        force = rise.peak_force_N[k]
        cells = (
            f"{rise.time[k] / 60:.1f}",
            *(f"{kelvin[k] - ZERO_CELSIUS_K:.1f}" for kelvin in parts),
            f"{force:.0f}" if math.isfinite(force) else "-",
            f"{rise.mechanical_W[k] + rise.coil_W[k]:.1f}",
            f"{sum(watts[k] for watts in rise.paths_W.values()):.1f}",
        )
        rows.append(cells)
    columns = ("fluid degC", "max", "coil degC", "max", "wall degC", "peak force N", "W in", "W out")
    return terminal_table("", ("minutes", *columns), rows)


def _sentences(rise: Rise, interval: PredictionInterval | None) -> list[str]:
    after = f"after {rise.time[-1] / 60:.4g} min"
    band = end_band(rise, interval, "degC") or "extrapolated beyond the runs of the card"
    lines = [_limit_sentence(rise, interval, k) for k in range(len(rise.limits))]
    lines.append(f"Fluid {after}: {rise.fluid_degC[-1]:.1f} degC ({band}).")
    if rise.force_loss_percent is not None:
        lines.append(f"Peak force {after}: {rise.force_loss_percent:.1f} % lower than at 20 degC.")
    return lines


def _limit_sentence(rise: Rise, interval: PredictionInterval | None, index: int) -> str:
    reached, band = rise.limits[index], limit_band(interval, index)
    limit, hottest = reached.limit, reached.hottest - ZERO_CELSIUS_K
    when = f"not reached in {rise.time[-1] / 60:.4g} min"
    if reached.time_s is not None:
        when = f"reached after {reached.time_s / 60:.1f} min"
    return (
        f"Limit of the {limit.name} ({limit.celsius:.4g} degC, {limit.source.removeprefix('of ')}): {when}"
        f"{f' ({band})' if band else ''}. Hottest point {hottest:.1f} degC."
    )


def _energy_sentence(rise: Rise) -> str:
    """Return a sentence on the supplied energy and the percentages lost and stored."""
    energy, total = rise.energy_J, rise.input_J
    parts = [name for name in energy if name not in {"mechanical", "coil", "out"}]
    percents = ", ".join(f"{name} {100 * energy[name] / total:.0f} %" for name in parts) if total > 0 else "-"
    return f"Energy {total / 1e3:.1f} kJ: {percents}."


def _calibration_words(calibrated: CalibratedDrawing) -> list[str]:
    """Return lines with the factors of heat capacity and convection, their standard errors, the residual."""
    curve = calibrated.curve
    return [
        f"Calibrated with {curve.name} ({curve.place}, {curve.time[0] / 60:.4g} to "
        f"{curve.time[-1] / 60:.4g} min):",
        f"  Factor of heat capacity {calibrated.heat_capacity:.4g} +- {calibrated.heat_capacity_error:.1g}",
        f"  Factor of convection {calibrated.film:.4g} +- {calibrated.film_error:.1g}, "
        f"correlation {calibrated.correlation:.2f}",
        f"  Residual {calibrated.residual_K:.2g} K, noise of the sensor {curve.noise_K:.2g} K",
        *(f"  {note}" for note in calibrated.notes),
    ]


def _calibrated_text(run: HeatResult) -> str:
    """Return the text of the geometry file with calibrated values; all else is unchanged."""
    found, drawing = run.calibrated, run.drawing
    assert found is not None
    title = f"{drawing.name}, calibrated by {found.curve.name}"
    return calibrated_text(drawing.text, found.entries, title, sink=drawing.sink)


REPORT = Report(
    fields=_fields,
    show=show,
    summary=summary,
    page=PAGE,
    files=(
        WrittenFile(name="heat.json", key="file"),
        csv_file("heat.csv", _rows),
        replace(
            text_file("calibrated.toml", _calibrated_text, key="drawing"),
            when=lambda run: bool(run.drawing.text) and run.calibrated is not None,
        ),
    ),
    rows=_rows,
)
