"""Figures with many small panels: force loops of the runs of a fit, and residuals."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from matplotlib.figure import Figure

from mrdamper.identify.scores import RunError
from mrdamper.models.characteristics import pick_evenly
from mrdamper.report.figures.runs import PANEL_COLUMNS_MAX
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import MEASURED, colour_of
from mrdamper.report.identification.campaign import Campaign, Trace
from mrdamper.report.sections import Picture

LOOPS = ("displacement_mm", "velocity_mm_s")
_X_LABELS = {"displacement_mm": "displacement, mm", "velocity_mm_s": "velocity, mm/s", "time_s": "time, s"}

Drawn = tuple[str, str, RunError]  # title and colour of the panel of a run, and the run


def loop_pictures(campaign: Campaign) -> list[Picture]:
    """Return figures of force loops, one figure for each of at most four motions.

    A figure compares temperatures or, if all runs have the same temperature, currents. Then the main motion
    is omitted because the top of the page shows its loops at each current. Without such figures, a single
    figure shows the worst run of each motion.
    """
    if len(campaign.errors) <= PANEL_COLUMNS_MAX:
        return []
    motions = [error.motion for error in campaign.errors if error.motion != campaign.main]
    others = list(dict.fromkeys(motions))[:3]
    drawn: list[tuple[str, list[Drawn]]] = []
    if campaign.warm:
        strongest = max(campaign.commands, key=abs, default=None)
        for motion in (campaign.main, *others) if campaign.main else others:
            runs = _over_levels(campaign, motion, strongest)
            at = f"{runs[0][2].command:g} {runs[0][2].command_unit}, " if runs and runs[0][2].command else ""
            drawn.append((f"{motion}: {at}each temperature", runs))
    else:
        drawn += [(motion, _over_commands(campaign, motion, None)) for motion in others]
    if not any(runs for _, runs in drawn):
        worst = find_worst_by_motion(campaign.errors)[:PANEL_COLUMNS_MAX]
        drawn.append(("The worst run of each motion", _with_names(campaign, worst)))
    return [
        Picture(title, partial(_loops, campaign, runs, ["velocity_mm_s"])) for title, runs in drawn if runs
    ]


def _over_levels(campaign: Campaign, motion: str, command: float | None) -> list[Drawn]:
    """Return one run for each temperature, with a given current or with current steps."""
    picked = [
        (level, campaign.find_run(motion, level, command) or campaign.find_run(motion, level, None))
        for level in pick_evenly(campaign.levels.values, PANEL_COLUMNS_MAX)
    ]
    return [
        (campaign.levels.label(level), campaign.colour(level), run)
        for level, run in picked
        if run is not None
    ]


def _over_commands(campaign: Campaign, motion: str, level: float | None) -> list[Drawn]:
    unit = campaign.errors[0].command_unit
    picked = [
        (command, campaign.find_run(motion, level, command))
        for command in pick_evenly(campaign.commands, PANEL_COLUMNS_MAX)
    ]
    return [
        (f"{command:g} {unit}", colour_of(command, campaign.highest), run)
        for command, run in picked
        if run is not None
    ]


def _with_names(campaign: Campaign, errors: Sequence[RunError]) -> list[Drawn]:
    return [(error.name, colour_of(error.command, campaign.highest), error) for error in errors]


def overview(campaign: Campaign) -> Figure:
    """Return a figure of the force loops of up to seven runs.

    If there are more runs, the figure shows the main motion at each current and the worst run. Without a main
    motion, the figure shows the worst run of each motion.
    """
    drawn = _with_names(campaign, campaign.errors)
    if len(drawn) > PANEL_COLUMNS_MAX:
        level = campaign.levels.values[0] if campaign.warm else None
        loops = [] if campaign.main is None else _over_commands(campaign, campaign.main, level)
        loops = list(pick_evenly(loops, 5))
        worst = _with_names(campaign, find_worst_by_motion(campaign.errors)[:PANEL_COLUMNS_MAX])
        drawn = [*loops, ("worst run", *worst[0][1:])] if loops else worst
    return _loops(campaign, drawn)


def _loops(campaign: Campaign, drawn: Sequence[Drawn], names: Sequence[str] = LOOPS) -> Figure:
    """Return a figure of measured and modelled force, one column for each run.

    Each row has another x axis, listed in ``names``. If all runs have current steps or no period, the force
    is drawn only versus time.
    """
    traces = campaign.traces([run for *_, run in drawn])
    names = ("time_s",) if all(trace.over_time for trace in traces) else names
    found = []
    for name in names:
        for trace, (title, colour, run) in zip(traces, drawn, strict=True):
            x = getattr(trace, name)
            lines = [
                Line(x, trace.measured_N, MEASURED, width=2.6),
                Line(x, trace.modelled_N, colour, width=0.8),
            ]
            heading = f"{run.rmse_N:.0f} N · {title}" if name == names[0] else ""
            label = "force, N" if trace is traces[0] else ""
            found.append(Panel(heading, _X_LABELS[name], lines, run.split != "training", label))
    return panel_figure(found, len(drawn), height=1.3, share="row")


def residual_figure(campaign: Campaign) -> Figure:
    """Return a figure of measured minus modelled force versus velocity.

    There is a panel of the main motion for each temperature. If all runs have the same temperature, there is
    a panel for each motion.
    """
    if campaign.warm and campaign.main is not None:
        groups: list[tuple[str, str, float | None]] = [
            (campaign.levels.label(level), campaign.main, level)
            for level in pick_evenly(campaign.levels.values, PANEL_COLUMNS_MAX)
        ]
    else:
        motions = list(dict.fromkeys(error.motion for error in campaign.errors))
        groups = [(motion, motion, None) for motion in pick_evenly(motions, PANEL_COLUMNS_MAX)]
    found: dict[str, list[Trace]] = {}
    for title, motion, level in groups:
        runs = [campaign.find_run(motion, level, command) for command in (*campaign.commands, None)]
        if known := [run for run in runs if run is not None]:
            found[title] = campaign.traces(known)

    drawn: list[Panel] = []
    for title, traces in found.items():
        lines = [
            Line(
                trace.velocity_mm_s,
                trace.measured_N - trace.modelled_N,
                colour_of(trace.error.command, campaign.highest),
                width=0.8,
                style="-" if trace.error.split == "training" else "--",
            )
            for trace in traces
        ]
        label = "" if drawn else "measured - modelled, N"
        drawn.append(Panel(title, _X_LABELS["velocity_mm_s"], lines, y_label=label))
    return panel_figure(drawn, len(found), height=1.6, share="row")


def find_worst_by_motion(errors: Sequence[RunError]) -> list[RunError]:
    """Return the run with the largest error [%] of each motion, the worst run first.

    Runs with current steps are returned only if no run has a constant current, because they have no loops.
    """
    steady = [error for error in errors if error.command is not None]
    worst: dict[str, RunError] = {}
    for error in sorted(steady or errors, key=lambda e: (-e.nrmse_percent, e.name)):
        worst.setdefault(error.motion, error)
    return list(worst.values())
