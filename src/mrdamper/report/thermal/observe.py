"""What ``observe`` found: the answer's keys, lines for a terminal, the picture, the table."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.arrays import FloatArray
from mrdamper.jobs.thermal.observe import ObserveResult, PlaceTemperature
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import FirstScreen, Tile, course_report, print_notes
from mrdamper.report.figures.style import HELD_OUT, MEASURED, TRAINING, WIDE
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.time_to_limit import draw_limit, limit_answer, limit_tile, limit_words
from mrdamper.schema import Json

_COIL_COLOUR = "#b08a3c"


def _places(found: ObserveResult) -> Iterator[tuple[str, PlaceTemperature]]:
    yield from (("fluid", found.fluid), ("coil", found.coil), ("body", found.body))


def _interval(found: ObserveResult, place: PlaceTemperature) -> tuple[FloatArray, FloatArray]:
    half = found.interval_width * place.error_K
    return place.celsius - half, place.celsius + half


def _answer(found: ObserveResult) -> Json:
    low, high = _interval(found, found.fluid)
    return {
        "probability": found.probability,
        "time_s": found.record.time.tolist(),
        "fluid_degC": found.fluid.celsius.tolist(),
        "fluid_low_degC": low.tolist(),
        "fluid_high_degC": high.tolist(),
        "coil_degC": found.coil.celsius.tolist(),
        "body_degC": found.body.celsius.tolist(),
        "power_W": found.power_W,
        "current_A": found.current_A,
        **limit_answer(found.limit_degC, found.to_limit),
        "factors": {
            name: {"value": value, "relative_standard_deviation": spread}
            for name, (value, spread) in found.factors.items()
        },
        "notes": list(found.notes),
    }


def _summary(found: ObserveResult) -> list[str]:
    """Return how hot the fluid is, how hot it was at most, and the time that is left."""
    low, high = _interval(found, found.fluid)
    hottest = int(found.fluid.celsius.argmax())
    clock = found.record.time / 60.0
    return [
        f"fluid at the end, {clock[-1]:.1f} min: {found.fluid.celsius[-1]:.1f} degC "
        f"({100.0 * found.probability:.0f} %: {low[-1]:.1f} to {high[-1]:.1f} degC)",
        f"hottest: {found.fluid.celsius[hottest]:.1f} degC at {clock[hottest]:.1f} min",
        f"from there on with {found.power_W:.0f} W and {found.current_A:.2g} A: "
        + limit_words(found.limit_degC, found.to_limit, found.probability, found.to_limit.looked_s),
    ]


def _show(found: ObserveResult, console: Console) -> None:
    rows = []
    for k in np.unique(np.linspace(0, len(found.record.time) - 1, 7).astype(int)):
        cells = (f"{place.celsius[k]:.1f} ± {place.error_K[k]:.1f}" for _, place in _places(found))
        rows.append((f"{found.record.time[k] / 60.0:.1f}", *cells))
    title = f"{found.record.name}: temperatures, degC, and their standard deviations"
    console.print(terminal_table(title, ("minutes", *(name for name, _ in _places(found))), rows))
    for line in _summary(found):
        console.print(line)
    print_notes(found.notes, console)


def _figure(found: ObserveResult) -> Figure:
    """Return the fluid with its interval, coil and body, what was read of them, and the limit."""
    figure = Figure(figsize=(WIDE, 3.4))
    axes = figure.add_subplot()
    minutes = found.record.time / 60.0
    if found.coil_read is not None:
        axes.plot(
            minutes,
            found.coil_read.celsius,
            color=MEASURED,
            linewidth=0.8,
            label="coil, by its resistance alone",
        )
    if found.record.body is not None:
        read = found.record.body - ZERO_CELSIUS_K
        axes.plot(minutes, read, ".", color=MEASURED, markersize=2, label="body, read")
    low, high = _interval(found, found.fluid)
    said = f"fluid, {100.0 * found.probability:.0f} %"
    axes.fill_between(minutes, low, high, color=HELD_OUT, alpha=0.16, linewidth=0, label=said)
    for (name, place), colour, width in zip(
        _places(found), (HELD_OUT, _COIL_COLOUR, TRAINING), (1.6, 1.0, 1.0), strict=True
    ):
        axes.plot(minutes, place.celsius, color=colour, linewidth=width, label=name)
    draw_limit(axes, found.limit_degC, float(high.max()), float(minutes[0]))
    axes.set_xlabel("minutes")
    axes.set_ylabel("temperature, °C")
    axes.legend(loc="lower right")
    figure.subplots_adjust(left=0.08, right=0.98, top=0.96, bottom=0.13)
    return figure


def _first(found: ObserveResult) -> FirstScreen:
    low, high = _interval(found, found.fluid)
    percent, hottest = f"{100.0 * found.probability:.0f} %", int(found.fluid.celsius.argmax())
    words = limit_words(found.limit_degC, found.to_limit, found.probability, found.to_limit.looked_s).replace(
        "degC", "°C"
    )
    ended = found.record.time[-1] / 60.0
    return FirstScreen(
        title=f"Temperatures within the damper: {found.record.name}",
        subject=f"{len(found.record.time)} rows; from the end on {found.power_W:.0f} W and "
        f"{found.current_A:.2g} A.",
        verdict=f"the fluid is at {found.fluid.celsius[-1]:.1f} °C after {ended:.1f} min; limit of {words}",
        tiles=(
            Tile(
                f"{found.fluid.celsius[-1]:.1f} °C",
                "fluid at the end",
                f"{percent}: {low[-1]:.1f} to {high[-1]:.1f} °C",
            ),
            limit_tile(found.limit_degC, found.to_limit, found.probability),
            Tile(
                f"{found.fluid.celsius[hottest]:.1f} °C",
                "fluid at its hottest",
                f"{percent}: {low[hottest]:.1f} to {high[hottest]:.1f} °C",
            ),
        ),
        caption="Grey: what was read; lines: the observer's estimates, the fluid with its interval",
        notes=found.notes,
    )


def _rows(found: ObserveResult) -> list[dict[str, object]]:
    columns = {"time_s": found.record.time}
    for name, place in _places(found):
        columns |= {f"{name}_degC": place.celsius, f"{name}_error_K": place.error_K}
    if found.coil_read is not None:
        columns["coil_read_degC"] = found.coil_read.celsius
    return [
        {
            name: None if np.isnan(values[k]) else round(float(values[k]), 6)
            for name, values in columns.items()
        }
        for k in range(len(found.record.time))
    ]


REPORT = course_report(
    "observe",
    answer=_answer,
    show=_show,
    summary=_summary,
    first=_first,
    picture=_figure,
    label="Temperatures within the damper",
    rows=_rows,
)
