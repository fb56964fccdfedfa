"""What ``cycles`` found: the answer's keys, the tables of a terminal, page, figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.data.cycle_groups import FigureSummary
from mrdamper.identify.cycle_errors import CycleErrors, ModelErrors
from mrdamper.jobs.cycles import CyclesResult
from mrdamper.report.base import (
    DONE,
    FirstScreen,
    Outcome,
    Page,
    Report,
    Tile,
    WrittenFile,
    interrupted,
    print_notes,
)
from mrdamper.report.check import findings_table
from mrdamper.report.figures.style import HELD_OUT, INK, TRAINING, WIDE
from mrdamper.report.sections import Column, Section, Table
from mrdamper.schema import Json

TITLES = {
    "energy_J": "energy per cycle, J",
    "highest_force_N": "highest force, N",
    "lowest_force_N": "lowest force, N",
    "stiffness_N_per_mm": "secant stiffness, N/mm",
    "temperature_degC": "mean temperature, °C",
    "amplitude_mm": "amplitude, mm",
    "period_s": "period, s",
    "model_energy_J": "the model's energy per cycle, J",
    "model_highest_force_N": "the model's highest force, N",
    "model_lowest_force_N": "the model's lowest force, N",
    "error_N": "the model's RMS error, N",
    "error_percent": "the model's RMS error, % of the cycle's spread of force",
    "mean_error_N": "its mean error, N",
}
_PANELS = (
    ("energy_J",),
    ("highest_force_N", "lowest_force_N"),
    ("error_N", "mean_error_N"),
    ("stiffness_N_per_mm",),
    ("temperature_degC",),
)

_BESIDE = {
    "energy_J": "model_energy_J",
    "highest_force_N": "model_highest_force_N",
    "lowest_force_N": "model_lowest_force_N",
}
_MOST_FLAGS = 2  # findings on the first screen


def _first(result: CyclesResult) -> FirstScreen:
    rows, least = result.rows, result.least_stroke_m
    stroke = "" if least is None else f"; a cycle has a stroke of more than {1e3 * least:.4g} mm"
    step = "" if result.step_s is None else f", usual step {result.step_s:.4g} s"
    broken = f"; cycles left out at breaks: {result.broken_cycles:,}" if result.broken_cycles else ""
    flags = []
    if result.cancelled:
        flags.append(("Interrupted", f"These are the cycles of the first {rows} rows only"))
    if not result.cycles:
        remedy = "Set a smaller least stroke, or look at the record's channels"
        flags.append(("No cycle was found", f"Nothing moves to and fro so far. {remedy}"))
    if result.model is not None and result.model.errors is None:
        flags.append(("No error of the model", "No cycle has a force of the model"))
    flags += [(each.found, f"{each.effect}. {each.remedy}") for each in result.findings[:_MOST_FLAGS]]
    said = f"{result.cycles:,} cycles took up {result.energy_J:.5g} J"
    errors = None if result.model is None else result.model.errors
    if errors is not None:
        said += f"; the model is {errors.rmse_N:.4g} N from the measured force (RMS)"
    return FirstScreen(
        title=f"{result.cycles} cycles of {result.record.path.name}",
        subject=f"{result.record.path}: {rows:,} rows ({result.record.understood}){step}{stroke}{broken}.",
        verdict=said,
        tiles=_tiles(result),
        caption="Figures over the number of the cycle"
        + (
            ""
            if result.groups.size == 1
            else f": means of {result.groups.size} cycles, bands from least to most"
        ),
        flags=flags,
        notes=[] if result.model is None else result.model.notes,
    )


def _tiles(result: CyclesResult) -> tuple[Tile, Tile, Tile]:
    """Return energy, force and temperature (or stiffness) of a cycle; of a replayed card, its errors."""
    errors = None if result.model is None else result.model.errors
    if errors is not None:
        energy = (
            "" if not errors.energy_J > 0 else f"{100 * (errors.model_energy_J / errors.energy_J - 1):+.2f} %"
        )
        return (
            Tile(
                f"{errors.rmse_N:.4g} N",
                f"RMS error over {errors.cycles} cycles",
                f"{errors.nrmse_percent:.3g} % of the force's spread; "
                f"{errors.percent_of_peak:.3g} % of its peak",
            ),
            Tile(
                f"{errors.mean_error_N:.3g} N",
                "mean error, model less measured",
                f"peak {errors.peak_N:.4g} N",
            ),
            Tile(energy or "–", "energy, model against measured", f"measured {errors.energy_J:.4g} J"),
        )
    named = [("energy_J", "J", "energy per cycle"), ("highest_force_N", "N", "highest force")]
    warm = "temperature_degC" in result.figures
    named.append(
        ("temperature_degC", "°C", "mean temperature")
        if warm
        else ("stiffness_N_per_mm", "N/mm", "stiffness")
    )
    first, second, third = (_tile(result.figures.get(name), unit, label) for name, unit, label in named)
    return first, second, third


def _tile(found: FigureSummary | None, unit: str, label: str) -> Tile:
    if found is None:
        return Tile("–", label)
    return Tile(f"{found.mean:.4g} {unit}", f"{label}, mean", f"{found.least:.4g} to {found.most:.4g} {unit}")


def _over_cycles(result: CyclesResult) -> Figure | None:
    """Return a panel for each figure over the number of the cycle: the groups' means, and their range.

    The model's are dashed.
    """
    groups, known = result.groups, set(result.figures)
    panels = [panel for panel in _PANELS if panel[0] in known]
    if not panels:
        return None
    count = -(-len(panels) // 2)
    height = 1.35 * count + 0.4
    figure = Figure(figsize=(WIDE, height))
    places = figure.subplots(count, min(len(panels), 2), sharex=True, squeeze=False).ravel(order="F")
    for axes, panel in zip(places, panels, strict=False):
        for name, colour in zip(panel, (TRAINING, HELD_OUT), strict=False):
            k = groups.names.index(name)
            least, most = groups.least[:, k], groups.most[:, k]
            if groups.size > 1:
                axes.fill_between(groups.number, least, most, color=colour, alpha=0.25, linewidth=0)
            mark = "." if len(groups.count) < 2 else ""
            axes.plot(groups.number, groups.mean[:, k], mark or "-", color=colour, linewidth=1.0)
            beside = _BESIDE.get(name, "")
            if beside in known:
                model = groups.mean[:, groups.names.index(beside)]
                axes.plot(groups.number, model, mark or "--", color=INK, linewidth=0.9)
        said = "; ".join(TITLES[name] for name in panel)
        if _BESIDE.get(panel[0]) in known:
            said += "; the model's dashed"
        axes.set_title(said[0].upper() + said[1:], loc="left", pad=3)
    for axes in places[len(panels) :]:
        axes.remove()
    for axes in places[count - 1 : len(panels) : count]:
        axes.set_xlabel("cycle", labelpad=1.5)
    figure.subplots_adjust(
        left=0.06, right=0.99, top=1.0 - 0.22 / height, bottom=0.36 / height, hspace=0.3, wspace=0.14
    )
    return figure


# ------------------------------------------------------------------------------------------- the tables


def _sections(result: CyclesResult) -> list[Section]:
    found: list[Section] = []
    if result.findings:
        found.append(findings_table(result.findings))
    if result.model is not None and result.model.errors is not None:
        title = f"The model: {result.model.card.title or result.model.card.damper.law.name}"
        found.append(_model_table(result.model, title))
    if result.figures:
        found.append(_figures_table(result, "Over the cycles"))
    return found


def _figures_table(
    result: CyclesResult, title: str, words: Mapping[str, str] = TITLES
) -> Table[tuple[str, FigureSummary]]:
    """Return the table of each figure over the cycles; ``words`` are what it calls them."""
    count = result.groups.size
    ends = f"means of the first and the last {count} cycles at most" if count > 1 else "single cycles"

    def figure(title: str, form: str = ".5g") -> Column[tuple[str, FigureSummary]]:
        return Column(title, lambda row: getattr(row[1], title), form=form)

    return Table(
        title=title,
        columns=[
            Column("figure", lambda row: words.get(row[0], row[0])),
            *map(figure, ("first", "last", "mean", "least", "most")),
            Column("change", lambda row: _change(*row), "%", ".1f", printed=False),
            Column("per 1000 cycles", lambda row: row[1].trend_per_1000_cycles, form=".5g"),
        ],
        rows=[(name, result.figures[name]) for name in TITLES if name in result.figures],
        caption=f"First and last are {ends}; the trend is a straight line by least squares. Energy: the "
        "integral of force over displacement by the trapezoidal rule, closed over the cycle. Stiffness: "
        "the secant through the extremes of displacement. Every cycle is in cycles.csv.",
    )


def _change(name: str, figure: FigureSummary) -> float | None:
    """Return how much more the last cycles have than the first [%]; None for degrees, which have no share."""
    return 100.0 * (figure.last / figure.first - 1.0) if figure.first and name != "temperature_degC" else None


def _model_table(model: ModelErrors, title: str) -> Table[tuple[str, CycleErrors]]:
    """Return the table of a card's errors, by the mean temperature of the cycle and in all."""
    assert model.errors is not None
    rules, said = (
        model.rules,
        f"{model.card.file} ({model.card.damper.law.name}), replayed over the whole record",
    )
    conditioned = without = ""
    if rules is not None:
        conditioned = (
            f" Displacement smoothed at {rules.cutoff_Hz:.4g} Hz, dead band {1e3 * rules.dead_band_m:.3g} "
            f"mm, zero at {1e3 * rules.reference_m:.4g} mm, as chosen from the record's head"
            + ("." if rules.even else f"; resampled to a step of {rules.step_s:.4g} s.")
        )
    if model.cycles_without:
        without = f" {model.cycles_without} cycles have no force of the model."

    def error(title: str, name: str, unit: str = "", form: str = ".4g") -> Column[tuple[str, CycleErrors]]:
        return Column(title, lambda row: getattr(row[1], name), unit, form)

    def energy(title: str, name: str) -> Column[tuple[str, CycleErrors]]:
        per_cycle = lambda row: getattr(row[1], name) / row[1].cycles  # noqa: E731
        return Column(title, per_cycle, "J per cycle", ".4g", printed=False)

    return Table(
        title=title,
        columns=[
            Column("mean temperature", lambda row: row[0], "degC", "s"),
            error("cycles", "cycles", form=",d"),
            error("RMS error", "rmse_N", "N"),
            error("RMS error", "nrmse_percent", "% of the spread"),
            error("mean error", "mean_error_N", "N"),
            energy("energy", "energy_J"),
            energy("the model's", "model_energy_J"),
        ],
        rows=[
            *((f"{each.from_degC:g} to {each.to_degC:g}", each.errors) for each in model.by_temperature),
            ("all", model.errors),
        ],
        caption=f"{said}, its state carried on. Spread is the standard deviation of the measured force "
        f"over these cycles.{conditioned}{without}",
    )


# ------------------------------------------------------------------------------------------- the answer


def _answer(result: CyclesResult) -> Json:
    """Return what ``mrdamper cycles --json`` prints, but for the files."""
    least = result.least_stroke_m
    return {
        "record": str(result.record.path),
        "understood": result.record.understood,
        "rows": result.rows,
        "step_s": result.step_s,
        "least_stroke_mm": None if least is None else 1e3 * least,
        "cycles": result.cycles,
        "broken_cycles": result.broken_cycles,
        "energy_J": result.energy_J,
        "group_cycles": result.groups.size,
        "figures": {name: _summary_json(summary) for name, summary in result.figures.items()},
        "model": None if result.model is None else _model_json(result.model),
        "findings": [dict(finding.to_dict()) for finding in result.findings],
        "cancelled": result.cancelled,
    }


def _summary_json(summary: FigureSummary) -> Json:
    told = asdict(summary)
    told.pop("slope")
    return {**told, "trend_per_1000_cycles": summary.trend_per_1000_cycles}


def _model_json(model: ModelErrors) -> Json:
    rules = model.rules
    return {
        "card": model.card.file,
        "title": model.card.title,
        "law": model.card.damper.law.name,
        **({"cycles": 0} if model.errors is None else asdict(model.errors)),
        "cycles_without": model.cycles_without,
        "by_temperature": [
            {"from_degC": each.from_degC, "to_degC": each.to_degC, **asdict(each.errors)}
            for each in model.by_temperature
        ],
        "conditioning": None
        if rules is None
        else {
            "step_s": rules.step_s,
            "resampled": not rules.even,
            "cutoff_Hz": rules.cutoff_Hz,
            "dead_band_mm": 1e3 * rules.dead_band_m,
            "reference_mm": 1e3 * rules.reference_m,
        },
        "stretches": model.segments,
        "notes": list(model.notes),
    }


def _rows(result: CyclesResult) -> list[dict[str, object]]:
    """Return the means of the groups as a table."""
    groups = result.groups
    return [
        {"cycle": number, **dict(zip(groups.names, mean, strict=True))}
        for number, mean in zip(groups.number.tolist(), groups.mean.tolist(), strict=True)
    ]


# --------------------------------------------------------------------------------------------- the terminal


def _show(result: CyclesResult, console: Console) -> None:
    """Print the figures over the cycles, and what is wrong with the record."""
    title = f"{result.cycles:,} cycles in {result.rows:,} rows"
    console.print(_figures_table(result, title, words={}).printed())
    model = result.model
    if model is not None:
        if model.errors is None:
            console.print("no cycle has a force of the model")
        else:
            title = f"{model.card.file} over {model.errors.cycles:,} cycles"
            console.print(_model_table(model, title).printed())
        print_notes(model.notes, console)
    for finding in result.findings:
        console.print(escape(f"- {finding.severity}: {finding.in_words()}"))


def _outcome(result: CyclesResult) -> Outcome:
    return interrupted() if result.cancelled else DONE


_PAGE = Page(
    name="cycles.html",
    first=_first,
    picture=_over_cycles,
    label="Figures over the cycles",
    sections=_sections,
)

REPORT: Report[CyclesResult] = Report(
    answer=_answer,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="cycles.csv", key="file", streamed=True),
        WrittenFile(name="summary.json", key="summary_file"),
    ),
    curves=lambda result: {"curves": result.groups.curves(), "titles": TITLES},
    rows=_rows,
    outcome=_outcome,
)
