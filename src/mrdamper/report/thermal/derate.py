"""Output of the command ``derate``: tables of the permissible load, C header."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.arrays import FloatArray
from mrdamper.jobs.thermal.derate import DerateResult
from mrdamper.report.base import Report, WrittenFile, csv_file, print_notes, text_file
from mrdamper.report.figures.style import panels
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import table_of, terminal_table
from mrdamper.schema import finite_or_none


def _fields(found: DerateResult) -> dict[str, object]:
    parts = np.array([*(each.name for each in found.limits), None], dtype=object)
    return {
        "duty": found.duty,
        "quantity": found.quantity,
        "unit": found.unit,
        "whole": found.whole,
        "probability": found.probability,
        "ambient_degC": found.ambient_degC,
        "air_m_s": found.air_m_s,
        "duration_min": found.duration_min,
        "largest": found.largest,
        "low": found.low,
        "high": found.high,
        "limited_by": parts[found.limited_by.astype(int)],
        "limits": [
            {"part": each.name, "limit_degC": each.celsius, "source": each.source} for each in found.limits
        ],
        "notes": found.notes,
    }


def _limited(found: DerateResult, part: float) -> str | None:
    return None if part < 0.0 else found.limits[int(part)].name


def _minutes(minutes: float) -> str:
    return "steady" if math.isinf(minutes) else f"{minutes:g} min"


def _cell(found: DerateResult, d: int, w: int, a: int) -> str:
    largest, low, high = (float(each[d, w, a]) for each in (found.largest, found.low, found.high))
    if math.isnan(largest):
        return "none"
    if math.isnan(low) or low < 0.995 * high:
        return f"{largest:.3g} ({'none' if math.isnan(low) else f'{low:.3g}'} to {high:.3g})"
    return f"{largest:.3g}"


def _summary(found: DerateResult) -> list[str]:
    """Return a line on all ambient conditions, and a line on the most severe one."""
    steady = found.largest[-1]
    allowed = int((steady >= found.whole * (1.0 - 1e-9)).sum())
    return [
        f"steady state: {allowed} of {steady.size} conditions allow the full {found.quantity} of "
        f"{found.whole:g} {found.unit}",
        f"{found.ambient_degC[-1]:g} degC, {found.air_m_s[0]:g} m/s, steady: "
        f"{_cell(found, -1, 0, -1)} {found.unit}",
    ]


def _show(found: DerateResult, console: Console) -> None:
    for line in _summary(found):
        console.print(escape(line))
    for d, minutes in enumerate(found.duration_min):
        sure = f"{100 * found.probability:.0f} % interval"
        title = f"Permissible {found.quantity} [{found.unit}], {_minutes(minutes)}, {sure}"
        places = range(len(found.ambient_degC))
        rows = [(f"{air:g}", *(_cell(found, d, w, a) for a in places)) for w, air in enumerate(found.air_m_s)]
        names = ("air m/s", *(f"{ambient:g} degC" for ambient in found.ambient_degC))
        console.print(terminal_table(title, names, rows))
    for limit in found.limits:
        text = f"Limit of the {limit.name}: {limit.celsius:.4g} degC {limit.source}, at its hottest point."
        console.print(escape(text))
    print_notes(found.notes, console)


def _figure(found: DerateResult) -> Figure:
    """Return a figure of the permissible load versus temperature and speed of the air."""
    figure, table = panels(len(found.duration_min), 5, gap=0.12, height=1.9, share="all")
    for axes, minutes, largest in zip(table, found.duration_min, found.largest, strict=True):
        axes.imshow(largest, origin="lower", aspect="auto", cmap="YlGnBu", vmin=0.0, vmax=2.0 * found.whole)
        axes.grid(visible=False)
        for (w, a), value in np.ndenumerate(largest):
            text = "none" if math.isnan(value) else f"{value:.3g}"
            axes.text(a, w, text, ha="center", va="center", fontsize=6.0)
        axes.set_xticks(range(len(found.ambient_degC)), [f"{each:g}" for each in found.ambient_degC])
        axes.set_yticks(range(len(found.air_m_s)), [f"{each:g}" for each in found.air_m_s])
        axes.set(title=_minutes(minutes), xlabel="ambient, °C")
    table[0].set_ylabel(f"air speed, m/s (permissible {found.quantity} in {found.unit})")
    return figure


def _rows(found: DerateResult) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for (d, w, a), part in np.ndenumerate(found.limited_by):
        values = {"largest": found.largest, "low": found.low, "high": found.high}
        rows.append(
            {
                "duration_min": finite_or_none(float(found.duration_min[d])),
                "air_m_s": float(found.air_m_s[w]),
                "ambient_degC": float(found.ambient_degC[a]),
                **{
                    f"{name}_{found.unit}".replace("%", "percent"): finite_or_none(float(each[d, w, a]))
                    for name, each in values.items()
                },
                "limited_by": _limited(found, float(part)),
            }
        )
    return rows


def _in_c(values: FloatArray) -> str:
    return ", ".join(f"{value:.4f}f" for value in values)


def _header(found: DerateResult) -> str:
    """Return the lower bounds of the permissible load as a C header; 0: no load."""
    axes = {
        "ambient_degC": found.ambient_degC,
        "air_m_s": found.air_m_s,
        "duration_min": np.where(np.isinf(found.duration_min), 1e9, found.duration_min),
    }
    sizes = "".join(f"[{n}]" for n in found.low.shape)
    lines = [
        f"/* Permissible {found.quantity} [{found.unit}] within all temperature limits, lower bound,",
        "   by duration (1e9 min is the steady state), air speed and ambient temperature. */",
        "#ifndef MRDAMPER_DERATE_H",
        "#define MRDAMPER_DERATE_H",
        *(f"static const float derate_{name}[{len(x)}] = {{{_in_c(x)}}};" for name, x in axes.items()),
        f"static const float derate_{found.quantity}{sizes} = {{",
        *("  {" + ", ".join(f"{{{_in_c(row)}}}" for row in each) + "}," for each in np.nan_to_num(found.low)),
        "};",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _first(found: DerateResult) -> FirstScreen:
    names = ", ".join(f"{each.name} {each.celsius:.4g} °C" for each in found.limits)

    def tile(place: str, d: int, w: int, a: int) -> Tile:
        air, ambient = found.air_m_s[w], found.ambient_degC[a]
        text = f"at {ambient:g} °C and {air:g} m/s, {_minutes(found.duration_min[d])}{place}"
        value, _, band = _cell(found, d, w, a).partition(" ")
        return Tile(f"{value} {found.unit}", text, band.strip("()"))

    middle = len(found.ambient_degC) // 2
    return FirstScreen(
        title=f"Derating of {found.name}",
        subject=f"Duty: {found.duty}; {found.quantity} up to {found.whole:g} {found.unit}.",
        verdict=_summary(found)[0],
        tiles=(tile(", the hottest corner", -1, 0, -1), tile("", -1, 0, middle), tile("", 0, 0, -1)),
        caption=f"Largest {found.quantity} in {found.unit} at which the hottest point of each part stays "
        f"below its limit ({names})",
        flags=[("The map is an extrapolation", note) for note in found.notes],
    )


PAGE = Page(
    name="derate.html",
    first=_first,
    picture=_figure,
    label="Derating maps",
    sections=lambda found: table_of(_rows(found)),
)


REPORT = Report(
    page=PAGE,
    fields=_fields,
    show=_show,
    summary=_summary,
    files=(
        WrittenFile(name="derate.json", key="file"),
        csv_file("derate.csv", _rows),
        text_file("derate.h", _header, key="header"),
    ),
    rows=_rows,
)
