"""What ``forecast`` found: the answer's keys, lines for a terminal, the picture, the table."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.jobs.thermal.forecast import ForecastResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import FirstScreen, Tile, course_report, print_notes
from mrdamper.report.figures.style import HELD_OUT, INK, WIDE
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.time_to_limit import draw_limit, limit_answer, limit_tile, limit_words
from mrdamper.schema import Json


def _answer(found: ForecastResult) -> Json:
    return {
        "curve": found.curve.name,
        "place": found.curve.place,
        "from_s": float(found.curve.time[0]),
        "to_s": float(found.curve.time[-1]),
        "probability": found.probability,
        "time_s": found.time_s.tolist(),
        "median_degC": found.median_degC.tolist(),
        "low_degC": found.low_degC.tolist(),
        "high_degC": found.high_degC.tolist(),
        **limit_answer(found.limit_degC, found.to_limit),
        "notes": list(found.curve.notes),
    }


def _summary(found: ForecastResult) -> list[str]:
    """Return how hot it gets and when the limit is reached."""
    minutes, percent = found.time_s[-1] / 60.0, f"{100.0 * found.probability:.0f} %"
    return [
        f"{found.curve.place} after {minutes:.0f} min: {found.median_degC[-1]:.1f} degC "
        f"({percent}: {found.low_degC[-1]:.1f} to {found.high_degC[-1]:.1f} degC)",
        limit_words(found.limit_degC, found.to_limit, found.probability, float(found.time_s[-1])),
    ]


def _show(found: ForecastResult, console: Console) -> None:
    rows = []
    for k in np.unique(np.linspace(0, len(found.time_s) - 1, 7).astype(int)):
        cells = (found.time_s[k] / 60.0, found.median_degC[k], found.low_degC[k], found.high_degC[k])
        rows.append([f"{each:.1f}" for each in cells])
    title = f"{found.curve.name}: {found.curve.place} to come, from {len(found.curve.time)} readings"
    console.print(terminal_table(title, ("minutes", "degC", "low", "high"), rows))
    for line in _summary(found):
        console.print(line)
    print_notes(found.curve.notes, console)


def _figure(found: ForecastResult) -> Figure:
    """Return what was measured, the interval to come and the limit."""
    figure = Figure(figsize=(WIDE, 3.4))
    axes = figure.add_subplot()
    minutes = found.time_s / 60.0
    said = f"{100.0 * found.probability:.0f} %"
    axes.fill_between(
        minutes, found.low_degC, found.high_degC, color=HELD_OUT, alpha=0.16, linewidth=0, label=said
    )
    axes.plot(minutes, found.median_degC, color=HELD_OUT, linewidth=1.6, label="forecast, median")
    celsius = found.curve.temperature - ZERO_CELSIUS_K
    axes.plot(found.curve.time / 60.0, celsius, ".", color=INK, markersize=2, label="measured")
    draw_limit(axes, found.limit_degC, float(found.high_degC.max()), float(minutes[0]))
    axes.set_xlabel("minutes")
    axes.set_ylabel(f"temperature of the {found.curve.place}, °C")
    axes.legend(loc="lower right")
    figure.subplots_adjust(left=0.08, right=0.98, top=0.96, bottom=0.13)
    return figure


def _first(found: ForecastResult) -> FirstScreen:
    curve, percent = found.curve, f"{100.0 * found.probability:.0f} %"
    minutes, spent = found.time_s[-1] / 60.0, (curve.time[-1] - curve.time[0]) / 60.0
    low, high = found.low_degC[-1], found.high_degC[-1]
    words = limit_words(found.limit_degC, found.to_limit, found.probability, float(found.time_s[-1])).replace(
        "degC", "°C"
    )
    return FirstScreen(
        title=f"Heating to come: {curve.name}",
        subject=f"From {len(curve.time)} readings of the {curve.place} over {spent:.1f} min.",
        verdict=f"after {minutes:.0f} min the {curve.place} is at {found.median_degC[-1]:.1f} °C; "
        f"limit of {words}",
        tiles=(
            Tile(
                f"{found.median_degC[-1]:.1f} °C",
                f"{curve.place} after {minutes:.0f} min",
                f"{percent}: {low:.1f} to {high:.1f} °C",
            ),
            limit_tile(found.limit_degC, found.to_limit, found.probability),
            Tile(f"{spent:.1f} min", "measured", f"up to {curve.temperature[-1] - ZERO_CELSIUS_K:.1f} °C"),
        ),
        caption="Points: measured; line: median of what is to come, with its interval",
        notes=curve.notes,
    )


def _rows(found: ForecastResult) -> list[dict[str, object]]:
    columns = (found.time_s, found.median_degC, found.low_degC, found.high_degC)
    names = ("time_s", "median_degC", "low_degC", "high_degC")
    return [
        dict(zip(names, (round(float(each[k]), 6) for each in columns), strict=True))
        for k in range(len(found.time_s))
    ]


REPORT = course_report(
    "forecast",
    answer=_answer,
    show=_show,
    summary=_summary,
    first=_first,
    picture=_figure,
    label="Temperatures to come",
    rows=_rows,
)
