"""Output of the command ``heatsink``: best fins compared with a reference."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Console
from rich.markup import escape

from mrdamper.files import toml_text
from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile, csv_file, print_notes, text_file
from mrdamper.report.figures.damper_section import dampers_figure
from mrdamper.report.figures.heat import front_figure, sweeps_figure
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import Column, Picture, Section, Table, print_compact
from mrdamper.report.thermal.heat_page import sink_in_words, temperature_flags
from mrdamper.schema import Json, write_record
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.sinks.design import SinkDesign
from mrdamper.thermal.sinks.effects import EFFICIENCY_FORMULA, Sweep


def _first(run: HeatsinkResult) -> FirstScreen:
    best, reference, limits, light = run.best, run.reference, run.limits, _lightest(run)
    method = _method(run)
    mass = f", {1e3 * limits.mass:.0f} g" if limits.mass < 1e9 else ""
    return FirstScreen(
        title=f"Heat sinks for {run.drawing.name}",
        subject=f"Load cycle: {run.duty.text}. Maximum {1e3 * limits.span:.4g} mm length, "
        f"{1e3 * limits.width:.4g} mm width{mass}. Fins at least {1e3 * limits.least_thickness:.3g} mm thick "
        f"and {1e3 * limits.least_gap:.3g} mm apart.",
        verdict=" ".join(_verdict(run)),
        tiles=(
            Tile(
                f"{best.fluid - ZERO_CELSIUS_K:.1f} °C",
                "fluid at the end of the load cycle with the coolest sink",
            ),
            Tile(
                f"{abs(run.gain.middle):.1f} K",
                f"{_comparison(run)} {_reference(run)} ({reference.fluid - ZERO_CELSIUS_K:.1f} °C, "
                f"{1e3 * reference.mass:.0f} g)",
                f"90 % interval {_interval(run)}",
            ),
            Tile(
                f"{1e3 * best.mass:.0f} g",
                "mass of the fins",
                "" if light is None else f"as cool as the reference: {1e3 * light.mass:.0f} g",
            ),
        ),
        caption=f"{run.found.tried} sinks of a grid were evaluated with the zone network. "
        f"{len(run.found.designs)} are on the Pareto front. {len(run.front)} of these were evaluated with "
        f"{method}",
        flags=temperature_flags(run.card),
        notes=run.notes,
    )


def _verdict(run: HeatsinkResult) -> list[str]:
    """Return sentences that compare the best heat sink with the reference."""
    assert run.best.sink is not None  # All designs of a search have sinks.
    lines = [
        f"Best heat sink: {sink_in_words(run.best.sink)}.",
        f"It is {abs(run.gain.middle):.1f} K {_comparison(run)} {_reference(run)} (90 % interval "
        f"{_interval(run)}, from the uncertainty of heat transfer and power).",
    ]
    if run.gain.low <= 0.0 <= run.gain.high:
        lines.append("The difference is not significant because the interval includes zero.")
    return lines


def _comparison(run: HeatsinkResult) -> str:
    return "cooler than" if run.gain.middle >= 0.0 else "warmer than"


def _interval(run: HeatsinkResult) -> str:
    """Return the interval of the temperature difference. Its middle is made positive."""
    low, high = (run.gain.low, run.gain.high) if run.gain.middle >= 0.0 else (-run.gain.high, -run.gain.low)
    return f"{low:.1f} to {high:.1f} K"


def _reference(run: HeatsinkResult) -> str:
    return "the reference" if run.reference.sink else "the bare damper"


def _lightest(run: HeatsinkResult) -> SinkDesign | None:
    """Return the lightest sink as cool as the reference, unless it is the best sink."""
    return None if run.reference.sink is None or run.lightest is run.best else run.lightest


def _sections(run: HeatsinkResult) -> list[Section]:
    found: list[Section] = [
        _front_table(run),
        Picture("Best sink and reference, to scale", lambda: dampers_figure(_dampers(run))),
    ]
    if (sweeps := run.sweeps) is not None:
        caption = (
            f"Eq. (10) of the paper is not legible and was assumed as {EFFICIENCY_FORMULA}. The values are "
            "from the zone network."
        )
        found.append(Picture("Parameter studies of the paper", lambda: sweeps_figure(sweeps), caption))
    return found


def _method(run: HeatsinkResult) -> str:
    return "finite elements" if run.best.model == "finite_element" else "the zone network"


def _designs(run: HeatsinkResult) -> list[tuple[str, SinkDesign]]:
    """Return the designs of the table, with labels such as "reference" or no label."""
    labelled = [
        ("bare", run.bare),
        *([("reference", run.reference)] if run.reference.sink is not None else []),
    ]
    light = run.lightest if run.reference.sink is not None else None
    return [
        *labelled,
        *(("as cool" if each is light else "", each) for each in run.front[:-1]),
        ("coolest", run.best),
    ]


def _front_table(run: HeatsinkResult) -> Table[tuple[str, SinkDesign]]:
    """Return a table of the bare damper, the reference and the Pareto front, one row for each design."""

    def size(title: str, name: str, least_fins: int = 1) -> Column[tuple[str, SinkDesign]]:
        def value(row: tuple[str, SinkDesign]) -> float | None:
            sink = row[1].sink
            return None if sink is None or sink.fins < least_fins else 1e3 * getattr(sink, name)

        return Column(title, value, "mm", ".3g")

    def degrees(title: str, name: str, *, printed: bool | str = True) -> Column[tuple[str, SinkDesign]]:
        return Column(title, lambda row: getattr(row[1], name) - ZERO_CELSIUS_K, "degC", ".1f", printed)

    return Table(
        title=f"Fluid temperature at the end of the load cycle and mass, by {_method(run)}",
        columns=[
            Column("", lambda row: row[0]),
            Column("fins", lambda row: 0 if row[1].sink is None else row[1].sink.fins, form="d"),
            size("width", "width"),
            size("thickness", "thickness"),
            size("pitch", "pitch", 2),  # A single fin has no pitch.
            Column("material", lambda row: "" if row[1].sink is None else row[1].sink.material.name),
            Column("mass", lambda row: 1e3 * row[1].mass, "g", ".1f", printed="g"),
            degrees("fluid", "fluid", printed="degC"),
            degrees("coil", "coil", printed=False),
            degrees("network", "network_fluid"),
        ],
        rows=_designs(run),
        caption="The label 'as cool' marks the lightest design that is as cool as the reference.",
        held=lambda row: row[0] == "reference",
    )


def _dampers(run: HeatsinkResult) -> list[tuple[str, DamperDrawing]]:
    """Return dampers with titles for a figure: reference, coolest, lightest as cool as the reference."""

    def titled(name: str, design: SinkDesign) -> tuple[str, DamperDrawing]:
        words = "no fins" if design.sink is None else sink_in_words(design.sink)
        values = f"{design.fluid - ZERO_CELSIUS_K:.1f} °C, {1e3 * design.mass:.0f} g"
        return f"{name}: {values}\n{words}", run.drawing.with_sink(design.sink)

    chosen = [titled("reference", run.reference), titled("coolest", run.best)]
    if (light := _lightest(run)) is not None:
        chosen.append(titled("lightest that is as cool as the reference", light))
    return chosen


def _fields(run: HeatsinkResult) -> dict[str, object]:
    """Return the values that ``mrdamper heatsink --json`` prints, without the paths of the files."""
    limits, lightest = run.limits, run.lightest
    return {
        "duty": run.duty.text,
        "reference": _design(run.reference),
        "bare": _design(run.bare),
        "front": _rows(run),
        "best": _design(run.best),
        "cooler_K": run.gain.middle,
        "cooler_interval_K": [run.gain.low, run.gain.high],
        "better": run.gain.better,
        "lightest_as_cool": None if lightest is None else _design(lightest),
        "limits": {
            "span_m": limits.span,
            "width_m": limits.width,
            "mass_kg": limits.mass,
            "least_thickness_m": limits.least_thickness,
            "least_gap_m": limits.least_gap,
            "materials": [material.name for material in limits.materials],
        },
        "search": {
            "tried": run.found.tried,
            "outside": run.found.outside,
            "front": len(run.found.designs),
        },
        "study": None if run.sweeps is None else _study(run.sweeps),
        "notes": run.notes,
        "cpu_s": round(run.cpu_s, 3),
    }


def _design(design: SinkDesign) -> Json:
    """Return dimensions, mass and temperatures of a design; no fins: dimensions are 0."""
    found = design.sink
    fins, *sizes = (0, 0.0, 0.0, 0.0)
    if found is not None:
        fins, *sizes = (found.fins, found.width, found.thickness, found.pitch)
    return {
        "fins": fins,
        **dict(zip(("width_m", "thickness_m", "pitch_m"), sizes, strict=True)),
        "mass_kg": design.mass,
        "temperature_degC": design.fluid - ZERO_CELSIUS_K,
        "model": design.model,
        "coil_degC": design.coil - ZERO_CELSIUS_K,
        "network_degC": design.network_fluid - ZERO_CELSIUS_K,
        "material": None if found is None else found.material.name,
        "emissivity": None if found is None else found.emissivity,
    }


def _rows(run: HeatsinkResult) -> list[Json]:
    return [_design(each) for each in run.front]


def _study(sweeps: tuple[Sweep, Sweep]) -> Json:
    """Return the parameter studies of width and number of fins (reference paper)."""
    study: Json = {"formula": EFFICIENCY_FORMULA, "follows_paper": {}}
    for name, sweep in zip(("width", "fins"), sweeps, strict=True):
        study["follows_paper"][name] = sweep.follows_paper
        study[name] = [
            {
                "fins": effect.sink.fins,
                "width_m": effect.sink.width,
                "temperature_degC": effect.finned - ZERO_CELSIUS_K,
                "efficiency_percent": 100.0 * effect.efficiency,
                "rise_reduction_percent": 100.0 * effect.rise_reduction,
                "fin_efficiency": effect.fin_efficiency,
            }
            for effect in sweep.effects
        ]
    return study


def _toml(run: HeatsinkResult) -> str:
    """Return the TOML text of the best sink for ``mrdamper heat --sink``."""
    best = run.best.sink
    assert best is not None  # All designs of a search have sinks.
    return toml_text({"sink": write_record(best, defaults=True)}, sink_in_words(best))


def _show(run: HeatsinkResult, console: Console) -> None:
    """Print sentences on the best heat sink, and a table of selected designs."""
    design_count_max = 8  # The table has at most 8 designs without a label. The page has all designs.
    for line in _verdict(run):
        console.print(escape(line))
    table = _front_table(run)
    others = [row for row in table.rows if not row[0]]
    step = max(-(-len(others) // design_count_max), 1)
    shown = others[::step]
    rows = [row for row in table.rows if row[0] or any(row is other for other in shown)]
    print_compact(replace(table, rows=rows).printed(whole=True), console)
    print_notes(run.notes, console)


_PAGE = Page(
    name="heatsink.html",
    first=_first,
    picture=front_figure,
    label="Front of temperature against mass",
    sections=_sections,
)

REPORT = Report(
    fields=_fields,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="heatsink.json", key="file"),
        csv_file("front.csv", _rows),
        text_file("best.toml", _toml),
    ),
    curves=lambda run: {"listed": [_design(each) for _, each in _designs(run)]},
    rows=_rows,
)
