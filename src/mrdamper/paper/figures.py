"""Sections of the demo report in the order of the paper, and the figures that only this report has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.track import Traced
from mrdamper.models.characteristics import pick_evenly
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.paper.findings import Findings
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.palette import colour_of_temperature
from mrdamper.report.figures.style import (
    HELD_OUT,
    INK,
    MEASURED,
    TRAINING,
    WIDTH_INCH,
    colour_of,
    drawing_style,
    svg_of,
)
from mrdamper.report.identification.campaign import Campaign

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_LOOPS = 4
# Plotted duration of a tracked force, and time between two plotted points.
_SHOWN_S, _THIN_S = 2.0, 2e-3
_FIELDS_T = (0.1, 0.2, 0.4, 0.6)


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """A figure of the report; ``figures`` has the numbers of the figures in the paper that it reproduces."""

    figures: str
    title: str
    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class Section:
    """A section of the report: title, row numbers of the claims, figures, and a link to a detailed report."""

    title: str
    caption: str
    rows: tuple[int, ...]
    report: str = ""
    plates: tuple[PaperFigure, ...] = ()


def sections_of(found: Findings) -> list[Section]:
    """Return the sections of the report in the order of the paper."""
    return [
        Section(
            "The fluid",
            "Section 2.2 of the paper.",
            (4, 5, 6, 7, 8, 9, 10, 11, 16),
            plates=(_fluid_plate(found.fluid),),
        ),
        Section(
            "Tests and hysteresis",
            "Sections 2.1, 2.3 and 4.1, Figures 6 to 10: loops versus temperature and current, and the model "
            "fitted to them, here with runs of the virtual rig.",
            (1, 2, 12, 13, 14, 15, 29),
            "identification/report.html",
            (_error_plate(found),),
        ),
        Section(
            "Heating",
            "Sections 2.1, 3.1 and 3.3, Figures 2, 11 to 13, 19 and 20: 15 mm, 1 Hz and 2 A, with and "
            "without the five fins.",
            (3, 17, 18, 24, 25, 26, 27, 28),
            "heating/heat.html",
        ),
        Section(
            "Heat sinks",
            "Section 3.2, Figures 14 to 18: widths and numbers of fins, and a better heat sink.",
            (19, 20, 21, 22, 23),
            "sink/sink.html",
        ),
        Section(
            "Force tracking",
            "Section 4.2, Figures 28 to 31: a target force without a force sensor. The controller uses only "
            "the card of the virtual damper.",
            (30, 31, 32, 33, 34, 35),
            "tracking/track.html",
        ),
        Section("Claims that cannot be checked", "", (36, 37)),
    ]


def way_figure(found: Findings) -> Figure:
    """Return one figure with three panels: loops, heating, and force tracking."""
    figure = Figure(figsize=(WIDTH_INCH, 3.3))
    loops, heating, tracking = figure.subplots(1, 3)
    _draw_loops(loops, Campaign(found.fitted, found.judged.runs))
    _draw_heating(heating, found)
    _draw_tracking(tracking, found.track.traced[0])
    figure.subplots_adjust(left=0.055, right=0.99, top=0.92, bottom=0.14, wspace=0.24)
    return figure


def _draw_loops(axes: Axes, campaign: Campaign) -> None:
    level = campaign.levels.values[0] if campaign.warm else None
    for command in pick_evenly(campaign.commands, _MOST_LOOPS):
        run = None if campaign.main is None else campaign.find_run(campaign.main, level, command)
        if run is None:
            continue
        trace = campaign.trace(run)
        axes.plot(trace.velocity_mm_s, trace.measured_N, color=MEASURED, linewidth=2.6)
        colour, label = colour_of(command, campaign.highest), f"{command:g} {run.command_unit}"
        axes.plot(trace.velocity_mm_s, trace.modelled_N, color=colour, linewidth=0.9, label=label)
    axes.set_title("Loops, measured and modelled", loc="left")
    axes.set_xlabel("velocity, mm/s")
    axes.set_ylabel("force, N")
    axes.legend(loc="upper left")


def _draw_heating(axes: Axes, found: Findings) -> None:
    for (title, rise), colour in zip(found.warm_up.rises, (TRAINING, HELD_OUT), strict=False):
        axes.plot(rise.time / 60.0, rise.fluid_degC, color=colour, linewidth=1.4, label=title)
    limit = found.warm_up.rise.limit_K - ZERO_CELSIUS_K
    axes.axhline(limit, color=INK, linewidth=0.8, linestyle=(0, (5, 2)), label="limit of the fluid")
    axes.set_title("Heating of the fluid", loc="left")
    axes.set_xlabel("minutes")
    axes.set_ylabel("fluid, °C")
    axes.margins(y=0.12)
    axes.legend(loc="lower right")


def _draw_tracking(axes: Axes, traced: Traced) -> None:
    course, run = traced.course, traced.runs[0]
    last = course.scored_from + round(_SHOWN_S / course.step_s)
    shown = slice(course.scored_from, last, max(round(_THIN_S / course.step_s), 1))
    time = course.time[shown]
    axes.fill_between(time, traced.reach.low[shown], traced.reach.high[shown], color="#ececec", linewidth=0)
    axes.plot(time, run.force[shown], color=TRAINING, linewidth=1.4, label=run.controller)
    axes.plot(time, course.target[shown], color=INK, linewidth=1.0, linestyle=(0, (4, 2)), label="target")
    axes.set_title(f"Force control, {traced.target} at {traced.temperature_degC:g} °C", loc="left")
    axes.set_xlabel("time, s")
    axes.set_ylabel("force, N")
    most = 1.5 * float(np.abs(course.target).max())
    axes.set_ylim(-most, most)
    axes.legend(loc="upper right", ncols=2)


def _fluid_plate(fluid: Fluid) -> PaperFigure:
    warm = np.linspace(20.0, 130.0, 111)
    over = np.linspace(20.0, 150.0, 261)
    viscosity = fluid.viscosity_Pa_s * np.asarray(fluid.viscosity_factor.value(over + ZERO_CELSIUS_K))
    if fluid.collapse is not None:
        viscosity = viscosity * fluid.collapse.value(over + ZERO_CELSIUS_K)
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.9))
        left, right = figure.subplots(1, 2)
        left.plot(over, 1e3 * viscosity, color=HELD_OUT, linewidth=1.6)
        left.axvspan(20.0, 60.0, color="#f1efe9", linewidth=0, zorder=0)
        left.annotate("20 to 60 °C", (21.5, 4.0), fontsize=6.5, color="#777777")
        left.set_ylim(bottom=0.0)
        left.set_ylabel("viscosity, mPa s")
        for k, tesla in enumerate(_FIELDS_T):
            stress = fluid.yield_stress(warm + ZERO_CELSIUS_K, flux_density_T=tesla)
            right.plot(
                warm,
                stress / 1e3,
                color=colour_of_temperature(k, range(len(_FIELDS_T))),
                label=f"{1e3 * tesla:.0f} mT",
            )
        right.set_ylim(bottom=0.0)
        right.set_ylabel("yield stress, kPa")
        right.legend(ncols=4, loc="lower left")
        for axes in (left, right):
            axes.set_xlabel("temperature, °C", labelpad=1.5)
            axes.margins(x=0.0)
        figure.subplots_adjust(left=0.055, right=0.99, top=0.97, bottom=0.15, wspace=0.14)
        svg = svg_of(figure, "Viscosity and yield stress over temperature")
    return PaperFigure(
        "4 and 5",
        "Viscosity without field, yield stress at four fields",
        "A law with the decrease of 65 % from the paper and a collapse above 138 °C; the formula of Carlson, "
        "with a linear decrease.",
        svg,
    )


def _error_plate(found: Findings) -> PaperFigure:
    return PaperFigure(
        "21 to 27",
        "RMS error over temperature",
        "All runs with constant current; the line joins the means. The law of the paper, one Bouc-Wen "
        "element with polynomials in current and temperature, is fitted to the same runs.",
        _errors(found),
    )


def _errors(found: Findings) -> str:
    with drawing_style():
        figure = Figure(figsize=(WIDTH_INCH, 2.7))
        axes = figure.add_subplot()
        for judged, colour, label in (
            (found.paper_law, HELD_OUT, "law of the paper"),
            (found.judged, TRAINING, f"{found.fitted.damper.law.name}, selected law"),
        ):
            points = [
                (round(e.temperature_degC), e.rmse_N)
                for e in judged.runs
                if e.command is not None and e.temperature_degC is not None
            ]
            levels = sorted({degrees for degrees, _ in points})
            axes.plot(*zip(*points, strict=True), "o", color=colour, markersize=2.4, alpha=0.4)
            means = [float(np.mean([rmse for at, rmse in points if at == level])) for level in levels]
            axes.plot(levels, means, color=colour, linewidth=1.6, label=label)
        axes.plot(
            (20.0, 40.0, 80.0, 120.0),
            (65.2, 64.8, 71.3, 72.6),
            "D",
            color=INK,
            markersize=4.0,
            label="values of the paper (another damper)",
        )
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("temperature, °C", labelpad=1.5)
        axes.set_ylabel("RMS error, N")
        axes.legend(loc="upper right", ncols=3)
        figure.subplots_adjust(left=0.055, right=0.99, top=0.97, bottom=0.16)
        return svg_of(figure, "RMS error over temperature")
