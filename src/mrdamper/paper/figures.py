"""Sections of the demo report in the order of the paper, and the figures that only this report has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.track import Traced
from mrdamper.models.characteristics import pick_evenly
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.paper.claims import Findings
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import (
    HELD_OUT,
    INK,
    MEASURED,
    TRAINING,
    colour_of,
    colour_of_temperature,
    svg_drawn_by,
)
from mrdamper.report.identification.campaign import Campaign

_MOST_LOOPS = 4
# Plotted duration of a tracked force, and time between two plotted points [s]
_SHOWN_S, _THIN_S = 2.0, 2e-3
_FIELDS_T = (0.1, 0.2, 0.4, 0.6)


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """A figure of the report that reproduces the figures with the numbers ``figures`` in the paper."""

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
    drawn = [_loops(Campaign(found.fitted, found.judged.runs)), _heating(found)]
    traced = found.track.traced[0]
    figure = panel_figure([*drawn, _tracking(traced)], height=2.6)
    axes, most = figure.axes[-1], 1.5 * float(np.abs(traced.course.target).max())
    axes.set_ylim(-most, most)
    axes.legend(loc="upper right", ncols=2)
    return figure


def _loops(campaign: Campaign) -> Panel:
    level = campaign.levels.values[0] if campaign.warm else None
    runs = [
        run
        for command in pick_evenly(campaign.commands, _MOST_LOOPS)
        if campaign.main is not None and (run := campaign.find_run(campaign.main, level, command)) is not None
    ]
    lines = []
    for trace in campaign.traces(runs):
        command = trace.error.command
        colour, label = colour_of(command, campaign.highest), f"{command:g} {trace.error.command_unit}"
        lines += [
            Line(trace.velocity_mm_s, trace.measured_N, MEASURED, width=2.6),
            Line(trace.velocity_mm_s, trace.modelled_N, colour, label, 0.9),
        ]
    return Panel("Loops, measured and modelled", "velocity, mm/s", lines, y_label="force, N")


def _heating(found: Findings) -> Panel:
    rises = found.warm_up.rises
    lines = [
        Line(rise.time / 60.0, rise.fluid_degC, colour, title, 1.4)
        for (title, rise), colour in zip(rises, (TRAINING, HELD_OUT), strict=False)
    ]
    limit, last = rises[0][1].limit_K - ZERO_CELSIUS_K, max(rise.time[-1] for _, rise in rises) / 60.0
    lines.append(Line((0.0, last), (limit, limit), INK, "limit of the fluid", 0.8, "--"))
    return Panel("Heating of the fluid", "minutes", lines, y_label="fluid, °C")


def _tracking(traced: Traced) -> Panel:
    course, run = traced.course, traced.runs[0]
    last = course.scored_from + round(_SHOWN_S / course.step_s)
    shown = slice(course.scored_from, last, max(round(_THIN_S / course.step_s), 1))
    time, reach = course.time[shown], (traced.reach.low[shown], traced.reach.high[shown])
    lines = [
        Line(time, reach[0], MEASURED, width=0.0, band=reach),
        Line(time, run.force[shown], TRAINING, run.controller, 1.4),
        Line(time, course.target[shown], INK, "target", 1.0, "--"),
    ]
    title = f"Force control, {traced.target} at {traced.temperature_degC:g} °C"
    return Panel(title, "time, s", lines, y_label="force, N")


def _fluid_plate(fluid: Fluid) -> PaperFigure:
    warm = np.linspace(20.0, 130.0, 111)
    over = np.linspace(20.0, 150.0, 261)
    viscosity = fluid.viscosity_Pa_s * np.asarray(fluid.viscosity_factor.value(over + ZERO_CELSIUS_K))
    if fluid.collapse is not None:
        viscosity = viscosity * fluid.collapse.value(over + ZERO_CELSIUS_K)
    stresses = [
        Line(
            warm,
            1e-3 * fluid.yield_stress(warm + ZERO_CELSIUS_K, flux_density_T=tesla),
            colour_of_temperature(tesla, _FIELDS_T),
            f"{1e3 * tesla:.0f} mT",
        )
        for tesla in _FIELDS_T
    ]
    drawn = [
        Panel("", "temperature, °C", [Line(over, 1e3 * viscosity, HELD_OUT)], y_label="viscosity, mPa s"),
        Panel("", "temperature, °C", stresses, y_label="yield stress, kPa"),
    ]
    return PaperFigure(
        "4 and 5",
        "Viscosity without field, yield stress at four fields",
        "A law with the decrease of 65 % from the paper and a collapse above 138 °C; the formula of Carlson, "
        "with a linear decrease.",
        svg_drawn_by(lambda: panel_figure(drawn, height=2.2), "Viscosity and yield stress over temperature"),
    )


def _error_plate(found: Findings) -> PaperFigure:
    lines = []
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
        means = [float(np.mean([rmse for at, rmse in points if at == level])) for level in levels]
        x, y = ([point[k] for point in points] for k in (0, 1))
        lines += [Line(x, y, colour, style="."), Line(levels, means, colour, label, 1.6)]
    paper = ((20.0, 40.0, 80.0, 120.0), (65.2, 64.8, 71.3, 72.6))
    lines.append(Line(*paper, INK, "values of the paper (another damper)", style="D"))
    panel = Panel("", "temperature, °C", lines, y_label="RMS error, N")
    return PaperFigure(
        "21 to 27",
        "RMS error over temperature",
        "All runs with constant current; the line joins the means. The law of the paper, one Bouc-Wen "
        "element with polynomials in current and temperature, is fitted to the same runs.",
        svg_drawn_by(lambda: panel_figure([panel], height=2.2), "RMS error over temperature"),
    )
