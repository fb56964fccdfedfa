"""What ``ride`` found: the answer's keys, lines for a terminal, the picture, the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.control.vehicle.drive import Ride
from mrdamper.control.vehicle.long_drive import Journey
from mrdamper.control.vehicle.roads import OBSTACLES
from mrdamper.jobs.ride import RideResult
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
from mrdamper.report.figures.style import HELD_OUT, MEASURED, TRAINING, WIDE, colour_of
from mrdamper.report.sections import terminal_table
from mrdamper.runtime.outputs import write_table
from mrdamper.schema import Json

_COLOURS: Mapping[str, str] = MappingProxyType(
    {"passive": MEASURED, "unaware": colour_of(0.0, 1.0), "controlled": HELD_OUT, "ideal": TRAINING}
)

_SHOWN_s = 3.0  # of the ride's end, or from shortly before an obstacle on
_BEFORE_s = 2.3
_MOST_POINTS = 1500  # of a drawn line


def _figures(ride: Ride) -> dict[str, float]:
    """Return what a ride is judged by, by the words of faces; root mean squares."""
    return {
        "weighted acceleration, m/s²": ride.weighted_acceleration_m_s2,
        "tyre load, N": ride.tyre_load_N,
        "rattle space, mm": 1e3 * ride.rattle_m,
    }


def _road(found: RideResult) -> str:
    """Return what was driven over."""
    options = found.options
    if found.profile:
        return found.profile
    if options.road_class in OBSTACLES:
        height, length = 1e3 * options.obstacle_height_m, options.obstacle_length_m
        return f"{options.road_class} of {height:g} mm over {length:g} m"
    return f"class {options.road_class}"


def _journeys(found: RideResult) -> dict[str, Journey]:
    both = {"passive": found.rides.passive_journey, "controlled": found.rides.journey}
    return {name: journey for name, journey in both.items() if journey is not None}


def _rows(found: RideResult) -> list[dict[str, object]]:
    """Return a row for each car; the ideal one has no damper that could warm."""
    journeys = _journeys(found)
    return [
        {
            "car": name,
            "body_acceleration_m_s2": ride.body_acceleration_m_s2,
            "weighted_acceleration_m_s2": ride.weighted_acceleration_m_s2,
            "tyre_load_N": ride.tyre_load_N,
            "rattle_m": ride.rattle_m,
            "most_rattle_m": ride.most_rattle_m,
            "end_stop_N": ride.end_stop_N,
            "heat_W": ride.heat_W,
            "mount_heat_W": ride.mount_heat_W,
            "current_rms_A": ride.current_rms_A,
            "body_speed_error_m_s": None if ride.state_errors is None else ride.state_errors[1],
            "wheel_speed_error_m_s": None if ride.state_errors is None else ride.state_errors[3],
            "force_error_N": ride.force_error_N,
            "hottest_fluid_degC": float(journeys[name].fluid_degC.max()) if name in journeys else None,
        }
        for name, ride in found.cars
    ]


def _temperatures(found: RideResult) -> list[dict[str, object]]:
    """Return a row for each driven segment of the long drive."""
    journeys = _journeys(found)
    columns = {}
    for name, journey in journeys.items():
        columns["time_s"] = journey.time
        for key in ("fluid_degC", "housing_degC", "heat_W", "coil_W", "body_acceleration_m_s2"):
            columns[f"{name}_{key}"] = getattr(journey, key)
    count = len(columns.get("time_s", ()))
    return [{name: float(values[k]) for name, values in columns.items()} for k in range(count)]


def _answer(found: RideResult) -> Json:
    return {
        "controller": found.options.controller,
        "demand": found.options.demand,
        "road_class": found.options.road_class,
        "profile": found.profile or None,
        "speed_m_s": found.options.speed_m_s,
        "states": found.options.states,
        "cars": _rows(found),
        "temperatures": _temperatures(found),
        "notes": list(found.notes),
    }


def _summary(found: RideResult) -> list[str]:
    """Return comfort, road holding and rattle space against the passive car, and how hot the damper gets."""
    passive, controlled, ideal = map(
        _figures, (found.rides.passive, found.rides.controlled, found.rides.ideal)
    )
    lines = [
        f"{name}: {controlled[name]:.4g} controlled, {passive[name]:.4g} passive "
        f"({100.0 * (controlled[name] / passive[name] - 1.0):+.0f} %), {ideal[name]:.4g} ideal"
        for name in passive
    ]
    known = found.rides.true_states
    if known is not None and found.rides.controlled.state_errors is not None:
        _, body, _, wheel = found.rides.controlled.state_errors
        share = {name: 100.0 * (controlled[name] / value - 1.0) for name, value in _figures(known).items()}
        costs = ", ".join(f"{name.partition(',')[0]} {each:+.1f} %" for name, each in share.items())
        lines.append(f"estimated states: {costs} against the true ones")
        lines.append(f"speed errors, mm/s rms: {1e3 * body:.3g} of the body, {1e3 * wheel:.3g} of the wheel")
    journeys = _journeys(found)
    if journeys:
        minutes = max(journey.time[-1] for journey in journeys.values()) / 60.0
        ends = ", ".join(f"{journey.fluid_degC[-1]:.0f} {name}" for name, journey in journeys.items())
        lines.append(f"fluid after {minutes:.0f} min, degC: {ends}")
    return lines


def _show(found: RideResult, console: Console) -> None:
    options = found.options
    rows = []
    for name, ride in found.cars:
        ends = (1e3 * ride.most_rattle_m, ride.end_stop_N)
        values = (*_figures(ride).values(), *ends, ride.heat_W, ride.current_rms_A)
        rows.append((name, *(f"{value:.4g}" for value in values)))
    driven = f"{_road(found)} at {options.speed_m_s:g} m/s, {options.demand}, {options.controller}"
    figures = (*_figures(found.rides.passive), "most rattle, mm", "end stop, N", "heat, W", "current, A")
    columns = ("car", *(name.replace(", ", "\n").replace(" ", "\n") for name in figures))
    console.print(terminal_table(f"{found.title}: {driven}", columns, rows, left=("car",)))
    for line in _summary(found):
        console.print(line)
    print_notes(found.notes, console)


def _figure(found: RideResult) -> Figure:
    """Return what the cars are judged by, the body's acceleration for a while, and the temperatures."""
    figure = Figure(figsize=(WIDE, 3.2))
    journeys = _journeys(found)
    widths = [1.0, 1.4, 1.0] if journeys else [1.0, 1.8]
    left, middle, *rest = figure.subplots(1, len(widths), width_ratios=widths)
    _draw_shares(left, found)
    _draw_acceleration(middle, found)
    for axes in rest:
        for name, journey in journeys.items():
            minutes, colour = journey.time / 60.0, _COLOURS[name]
            axes.plot(minutes, journey.fluid_degC, color=colour, linewidth=1.4, label=f"fluid, {name}")
            axes.plot(minutes, journey.housing_degC, color=colour, linewidth=0.8, linestyle="--")
        axes.set_xlabel("minutes on the road")
        axes.set_ylabel("fluid, and housing (dashed), °C")
        axes.legend(loc="lower right")
    figure.subplots_adjust(left=0.05, right=0.99, top=0.93, bottom=0.14, wspace=0.22)
    return figure


def _draw_shares(axes: Axes, found: RideResult) -> None:
    """Draw each car's figures as a share of the passive car's; their own numbers stand on the bars."""
    passive = _figures(found.rides.passive)
    drawn = [each for each in found.cars if each[0] in _COLOURS]
    places, width = np.arange(len(passive)), 0.8 / len(drawn)
    for k, (name, ride) in enumerate(drawn):
        values = _figures(ride)
        shares = [100.0 * values[each] / passive[each] for each in passive]
        at = places + (k - 0.5 * (len(drawn) - 1)) * width
        axes.bar(at, shares, 0.92 * width, color=_COLOURS[name], label=name)
        for x, share, value in zip(at, shares, values.values(), strict=True):
            text = f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
            axes.annotate(text, (x, share), (0, 1), textcoords="offset points", ha="center", fontsize=5.5)
    axes.set_xticks(places, [name.replace(", ", ",\n") for name in passive])
    axes.grid(visible=False, axis="x")
    axes.set_title("rms, % of the passive car's")
    axes.margins(y=0.25)
    axes.legend(loc="upper left", ncols=3, handlelength=1.0, columnspacing=1.0)


def _draw_acceleration(axes: Axes, found: RideResult) -> None:
    for name, ride in (("passive", found.rides.passive), ("controlled", found.rides.controlled)):
        shown = round(_SHOWN_s / ride.step_s)
        begins = len(ride.body) - shown
        if not found.profile and found.options.road_class in OBSTACLES:
            begins = min(begins, round(_BEFORE_s / ride.step_s))
        begins = max(begins, 0)
        thin = slice(begins, begins + shown, max(shown // _MOST_POINTS, 1))
        time = ride.step_s * np.arange(len(ride.force))
        axes.plot(time[thin], ride.body[thin], color=_COLOURS[name], linewidth=1.0, label=name)
    axes.set_xlabel("seconds")
    axes.set_title("acceleration of the body, m/s²")
    axes.margins(y=0.15)  # room for the legend
    axes.legend(loc="upper left", ncols=2)


def _first(found: RideResult) -> FirstScreen:
    options = found.options
    passive, controlled, ideal = map(
        _figures, (found.rides.passive, found.rides.controlled, found.rides.ideal)
    )
    better = {name: 100.0 * (controlled[name] / passive[name] - 1.0) for name in passive}
    comfort, grip, rattle = (
        Tile(
            f"{better[name]:+.0f} %",
            f"{name.partition(',')[0]} against the passive car",
            f"{controlled[name]:.4g}{name.partition(',')[2]}; passive {passive[name]:.4g}, "
            f"ideal {ideal[name]:.4g}",
        )
        for name in passive
    )
    first = next(iter(passive))
    return FirstScreen(
        title=f"Quarter car: {found.title}",
        subject=f"Road: {_road(found)} at {options.speed_m_s:g} m/s, {options.demand}, {options.controller}.",
        verdict=f"the controlled damper changes the {first.partition(',')[0]} by {better[first]:+.0f} % "
        "against the damper without current (root mean squares)",
        tiles=(comfort, grip, rattle),
        caption="Passive: the damper without current; ideal: the demanded force exactly",
        notes=found.notes,
    )


def _write_rows(rows: Sequence[Mapping[str, object]], path: Path) -> None:
    rounded = [
        {name: round(value, 6) if isinstance(value, float) else value for name, value in row.items()}
        for row in rows
    ]
    write_table(path, rounded)


REPORT = Report(
    answer=_answer,
    show=_show,
    summary=_summary,
    page=Page(
        name="ride.html",
        first=_first,
        picture=_figure,
        label="Rides of a quarter car",
        sections=lambda found: table_of(_rows(found)),
    ),
    files=(
        picture_file("ride.svg", _figure, "Rides of a quarter car"),
        WrittenFile(name="ride.json", key="file"),
        WrittenFile(name="ride.csv", write=lambda found, path: _write_rows(_rows(found), path)),
        WrittenFile(
            name="temperatures.csv",
            write=lambda found, path: _write_rows(_temperatures(found), path),
            when=lambda found: bool(_journeys(found)),
        ),
    ),
    rows=_rows,
)
