"""Sections for campaigns with many runs: small multiples of loops, residuals, errors by motion and level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.identify.scores import RunError
from mrdamper.models.characteristics import pick_evenly
from mrdamper.report.figures import small_multiples as panels
from mrdamper.report.figures.fit import Trace
from mrdamper.report.figures.palette import MEASURED, colour_of
from mrdamper.report.figures.runs import PANEL_COLUMNS_MAX
from mrdamper.report.figures.small_multiples import Line, Point, Row
from mrdamper.report.identification.campaign import Campaign, Key, Picture, command_keys
from mrdamper.report.identification.groups import ErrorTable, error_table


def loop_pictures(campaign: Campaign) -> list[Picture]:
    """Return small multiples of loops, by temperature at one current and by current at one temperature."""
    other_motion_count_max = 4
    motions = list(dict.fromkeys(error.motion for error in campaign.errors))
    main = campaign.main or max(motions, key=lambda m: sum(e.motion == m for e in campaign.errors))
    if not campaign.warm:
        ordered = [main, *(motion for motion in motions if motion != main)]
        return [
            picture
            for motion in ordered[: other_motion_count_max + 1]
            if (picture := _over_commands(campaign, motion, None)) is not None
        ]
    strongest = max(campaign.commands, key=abs, default=None)
    coldest = campaign.levels.values[0]
    found = [_over_levels(campaign, main, strongest), _over_commands(campaign, main, coldest)]
    others = sorted(
        (motion for motion in motions if motion != main),
        key=lambda motion: all(e.command is None for e in campaign.errors if e.motion == motion),
    )
    found.append(_other_motions(campaign, others[:other_motion_count_max], strongest))
    return [picture for picture in found if picture is not None]


def _over_levels(campaign: Campaign, motion: str, command: float | None) -> Picture | None:
    levels = pick_evenly(campaign.levels.values, PANEL_COLUMNS_MAX)
    picked = [(level, campaign.find_run(motion, level, command)) for level in levels]
    columns = [(campaign.levels.label(level), campaign.colour(level), error) for level, error in picked]
    svg = _loop_grid(campaign, columns, f"Loops of {motion} at each temperature")
    if svg is None:
        return None
    at = "" if command is None else f", {command:g} {campaign.errors[0].command_unit}"
    return Picture(f"{motion}{at}: each temperature", _ERROR_CAPTION, svg)


def _over_commands(campaign: Campaign, motion: str, level: float | None) -> Picture | None:
    unit = campaign.errors[0].command_unit
    picked = [
        (command, campaign.find_run(motion, level, command))
        for command in pick_evenly(campaign.commands, PANEL_COLUMNS_MAX)
    ]
    columns = [
        (f"{command:g} {unit}", colour_of(command, campaign.highest), error) for command, error in picked
    ]
    svg = _loop_grid(campaign, columns, f"Loops of {motion} at each command")
    if svg is None:
        return None
    at = "" if level is None else f", {campaign.levels.label(level)}"
    word = "current" if unit == "A" else "voltage"
    return Picture(f"{motion}{at}: each {word}", _ERROR_CAPTION, svg)


_ERROR_CAPTION = "The RMS error is above each column. It is red for held-out runs."


def overview(campaign: Campaign) -> Figure:
    """Return the loops of a few runs, or of the main motion at each current and the worst run."""
    unit, level = campaign.errors[0].command_unit, campaign.levels.values[0] if campaign.warm else None
    drawn = [(error.name, error) for error in campaign.errors]
    if len(drawn) > PANEL_COLUMNS_MAX:
        worst = find_worst_by_motion(campaign.errors)
        drawn = [
            (f"{command:g} {unit}", run)
            for command in pick_evenly(campaign.commands, 5)
            if campaign.main is not None
            and (run := campaign.find_run(campaign.main, level, command)) is not None
        ]
        drawn += [(f"worst: {run.name}", run) for run in worst[: 1 if drawn else PANEL_COLUMNS_MAX]]
    found = _loop_rows(
        campaign, [(title, colour_of(run.command, campaign.highest), run) for title, run in drawn]
    )
    assert found is not None  # A fit has at least one run.
    return panels.grid_figure(*found, tall=1.5)


def _loop_grid(
    campaign: Campaign, columns: Sequence[tuple[str, str, RunError | None]], label: str
) -> str | None:
    """Return force versus displacement and velocity as SVG, one column for each run."""
    found = _loop_rows(campaign, columns)
    return None if found is None else panels.grid(*found, label)


def _loop_rows(
    campaign: Campaign, columns: Sequence[tuple[str, str, RunError | None]]
) -> tuple[list[tuple[str, bool]], list[Row]] | None:
    """Return titles and panels of the loops, or None without runs."""
    known = [(title, colour, error) for title, colour, error in columns if error is not None]
    if not known:
        return None
    traces = [campaign.trace(error) for _, _, error in known]
    titles = [(f"{title} · {error.rmse_N:.0f} N", error.split != "training") for title, _, error in known]
    rows = []
    for name, x_label in (("displacement_mm", "displacement, mm"), ("velocity_mm_s", "velocity, mm/s")):
        panel = tuple(
            _both(trace, getattr(trace, name), colour)
            for trace, (_, colour, _) in zip(traces, known, strict=True)
        )
        rows.append(Row(x_label, "force, N", panel))
    return titles, rows


def _both(trace: Trace, x: FloatArray, colour: str) -> tuple[Line, ...]:
    return Line(x, trace.measured_N, MEASURED, 2.6), Line(x, trace.modelled_N, colour, 0.8)


def _other_motions(campaign: Campaign, motions: Sequence[str], command: float | None) -> Picture | None:
    """Return one row for each other motion and one column for each temperature."""
    step_run_time_s = 7.0  # Runs with current steps are drawn up to this time.
    levels = pick_evenly(campaign.levels.values, PANEL_COLUMNS_MAX)
    rows, splits = [], []
    for motion in motions:
        picked = [
            campaign.find_run(motion, level, command) or campaign.find_run(motion, level, None)
            for level in levels
        ]
        known = [error for error in picked if error is not None]
        if not known:
            continue
        stepped = known[0].command is None
        over_time = stepped or not campaign.runs[known[0].name].period_s
        traces = [
            None if error is None else campaign.trace(error, step_run_time_s if stepped else None)
            for error in picked
        ]
        row = tuple(
            ()
            if trace is None
            else _both(trace, trace.time_s if over_time else trace.displacement_mm, campaign.colour(level))
            for trace, level in zip(traces, levels, strict=True)
        )
        unit = known[0].command_unit
        at = "current steps" if stepped else f"{known[0].command:g} {unit}"
        at += ", held out" if all(error.split == "held_out" for error in known) else ""
        errors = ", ".join("–" if error is None else f"{error.rmse_N:.0f}" for error in picked)
        rows.append(
            Row(
                "time, s" if over_time else "displacement, mm",
                "force, N",
                row,
                f"{motion}, {at}   (RMS error {errors} N)",
            )
        )
        splits.append([None if error is None else error.split for error in picked])
    if not rows:
        return None
    titles = [
        (campaign.levels.label(level), all(split[column] in {"held_out", None} for split in splits))
        for column, level in enumerate(levels)
    ]
    caption = "One cycle, or the first seconds of a motion without a period. Held-out runs are red."
    return Picture("The other motions: each temperature", caption, panels.grid(titles, rows, "Other motions"))


def residual_picture(campaign: Campaign) -> Picture | None:
    """Return measured minus modelled force of the main motion at every level, coloured by current."""
    motion = campaign.main
    if motion is None or not campaign.warm:
        return None
    titles: list[tuple[str, bool]] = []
    over_velocity: list[tuple[Line, ...]] = []
    over_displacement: list[tuple[Line, ...]] = []
    for level in pick_evenly(campaign.levels.values, PANEL_COLUMNS_MAX):
        errors = [
            error
            for command in campaign.commands
            if (error := campaign.find_run(motion, level, command)) is not None
        ]
        if not errors:
            continue
        traces = [campaign.trace(error) for error in errors]
        titles.append((campaign.levels.label(level), all(error.split == "held_out" for error in errors)))
        for row, name in ((over_velocity, "velocity_mm_s"), (over_displacement, "displacement_mm")):
            row.append(
                tuple(
                    Line(
                        getattr(trace, name),
                        trace.measured_N - trace.modelled_N,
                        colour_of(trace.command, campaign.highest),
                        0.8,
                    )
                    for trace in traces
                )
            )
    if not titles:
        return None
    rows = [
        Row("velocity, mm/s", "meas. − mod., N", tuple(over_velocity)),
        Row("displacement, mm", "meas. − mod., N", tuple(over_displacement)),
    ]
    svg = panels.grid(titles, rows, f"Residual force of {motion}")
    return Picture(motion, "", svg, command_keys(campaign))


def find_worst_by_motion(errors: Sequence[RunError]) -> list[RunError]:
    """Return the run with the largest percent error of each motion, the worst one first.

    Runs with current steps are ignored if there are others because they are drawn versus time.
    """
    steady = [error for error in errors if error.command is not None]
    worst: dict[str, RunError] = {}
    for error in sorted(steady or errors, key=lambda e: (-e.nrmse_percent, e.name)):
        worst.setdefault(error.motion, error)
    return list(worst.values())


@dataclass(frozen=True, slots=True)
class ErrorSection:
    """Errors pooled by motion and level, as table and figure."""

    table: ErrorTable
    svg: str
    keys: tuple[Key, ...]
    columns: str  # kind of the levels


def error_section(campaign: Campaign) -> ErrorSection:
    """Return the RMS errors [N] by motion and temperature (or current) of training and held-out runs."""
    levels = campaign.levels
    table = error_table(campaign.errors, levels)
    placed = [error for error in campaign.errors if levels.level_of(error) is not None]
    motions: dict[str, list[tuple[float, float | None, Point]]] = {}
    for error in placed:
        x = error.temperature_degC if campaign.warm else error.command
        assert x is not None
        motions.setdefault(error.motion, []).append((x, error.command, Point(x, error.rmse_N, error.split)))
    pooled = {
        motion: [
            Point(level, value, split)
            for level, cell in zip(levels.values, cells, strict=True)
            for split, value in (("training", cell.training), ("held_out", cell.held_out))
            if value is not None
        ]
        for motion, cells in table.rows
    }
    unit = campaign.errors[0].command_unit
    of_command = "current, A" if unit == "A" else "voltage, V"
    label = "temperature, °C" if campaign.warm else of_command
    svg = panels.run_errors(motions, pooled, label, campaign.highest)
    return ErrorSection(table, svg, command_keys(campaign), label.partition(",")[0])
