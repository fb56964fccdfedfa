"""What ``sink`` found: the answer's keys, tables of a terminal, the page, the front as CSV, the best sink."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import FirstScreen, Page, Report, Tile, WrittenFile, print_notes
from mrdamper.report.figures.damper_section import draw_dampers
from mrdamper.report.figures.heatsink import draw_sweeps, draw_varied, front_figure
from mrdamper.report.sections import Column, Picture, Section, Table
from mrdamper.report.thermal.heat_page import sink_in_words, temperature_flags
from mrdamper.runtime.outputs import write_table
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.heatsink import FIN_LAWS
from mrdamper.thermal.sinks.design import SinkDesign
from mrdamper.thermal.sinks.efficiency import DEFAULT_EFFICIENCY, EFFICIENCIES, SinkEffect, Sweep
from mrdamper.thermal.sinks.gain import Spread
from mrdamper.thermal.sinks.variation import Variation


def _first(run: HeatsinkResult) -> FirstScreen:
    best, reference, limits = run.best, run.reference, run.limits
    judge = _judge(run)
    own = "the drawing's own sink" if reference.sink else "the bare damper"
    mass = f", {1e3 * limits.mass:.0f} g" if limits.mass < 1e9 else ""
    assert best.sink is not None  # a search returns sinks
    return FirstScreen(
        title=f"Heat sinks for {run.drawing.name}",
        subject=f"Duty: {run.duty.text}. Within {1e3 * limits.span:.4g} mm of length and "
        f"{1e3 * limits.width:.4g} mm of width{mass}; fins of "
        f"{1e3 * limits.least_thickness:.3g} mm or thicker, {1e3 * limits.least_gap:.3g} mm apart or more.",
        verdict=f"{sink_in_words(best.sink)}: {run.gain.middle:.1f} K cooler than {own}, by {judge}"
        + ("" if run.gain.better else "; whatever the films are, it is not surely better"),
        tiles=(
            Tile(
                f"{_degrees(best.fluid)} °C", "fluid at the end of the duty, coolest sink", _spread_band(run)
            ),
            Tile(
                f"{run.gain.middle:.1f} K",
                f"cooler than {own} ({_degrees(reference.fluid)} °C, {1e3 * reference.mass:.0f} g)",
                f"90 %: {run.gain.low:.1f} to {run.gain.high:.1f} K over films and power",
            ),
            Tile(f"{1e3 * best.mass:.0f} g", "mass of its fins", _lightest_band(run)),
        ),
        caption=f"{run.found.tried} sinks of a grid were tried on the zone network; {len(run.found.designs)} "
        f"are on the front, {len(run.front)} of them judged by {judge}",
        flags=temperature_flags(run.card),
        notes=run.notes,
    )


def _spread_band(run: HeatsinkResult) -> str:
    """Return what the fins' film coefficient leaves open, by the zone network."""
    found = [each.best for each in run.spread if each.best is not None]
    return f"{_degrees(min(found))} to {_degrees(max(found))} °C by other film laws" if len(found) > 1 else ""


def _lightest_band(run: HeatsinkResult) -> str:
    if run.lightest is None or run.reference.sink is None or run.lightest is run.best:
        return ""
    return f"as cool as the reference: {1e3 * run.lightest.mass:.0f} g"


def _sections(run: HeatsinkResult) -> list[Section]:
    found: list[Section] = [
        _front_table(run),
        Picture("To scale", lambda: draw_dampers(_dampers(run), "Best sink and reference, to scale")),
        Picture("The drawing's sink over its numbers", lambda: draw_varied(run)),
        _causes_table(run),
        _spread_table(run),
    ]
    if run.sweeps is not None:
        said = "Every panel has its own scale; coloured: as the paper's trend. By the zone network."
        found += [Picture("The paper's sweeps", lambda: draw_sweeps(run), said), _study_table(*run.sweeps)]
    return found


def _judge(run: HeatsinkResult) -> str:
    return "finite elements" if run.best.model == "finite_element" else "the zone network"


def _designs(run: HeatsinkResult) -> list[tuple[str, SinkDesign]]:
    """Return what the table of the front lists, each with what it is called; most have no name."""
    named = [("bare", run.bare), *([("reference", run.reference)] if run.reference.sink is not None else [])]
    light = run.lightest if run.reference.sink is not None else None
    return [
        *named,
        *(("as cool" if each is light else "", each) for each in run.front[:-1]),
        ("coolest", run.best),
    ]


def _front_table(run: HeatsinkResult) -> Table[tuple[str, SinkDesign]]:
    """Return the front beside the bare damper and the reference."""

    def size(title: str, name: str, least_fins: int = 1) -> Column[tuple[str, SinkDesign]]:
        def value(row: tuple[str, SinkDesign]) -> float | None:
            sink = row[1].sink
            return None if sink is None or sink.fins < least_fins else 1e3 * getattr(sink, name)

        return Column(title, value, "mm", ".3g")

    def degrees(title: str, name: str, *, printed: bool | str = True) -> Column[tuple[str, SinkDesign]]:
        return Column(title, lambda row: _celsius(getattr(row[1], name)), "degC", ".1f", printed)

    return Table(
        title=f"Heat sinks: fluid at the end of the duty against mass, by {_judge(run)}",
        columns=[
            Column("", lambda row: row[0]),
            Column("fins", lambda row: 0 if row[1].sink is None else row[1].sink.fins, form="d"),
            size("width", "width"),
            size("thickness", "thickness"),
            size("pitch", "pitch", 2),  # a single fin has none
            Column("material", lambda row: "" if row[1].sink is None else row[1].sink.material.name),
            Column("mass", lambda row: 1e3 * row[1].mass, "g", ".1f", printed="g"),
            degrees("fluid", "fluid", printed="degC"),
            degrees("coil", "coil", printed=False),
            degrees("network", "network_fluid"),
            degrees("steady", "steady", printed=False),
        ],
        rows=_designs(run),
        caption="Network: the fluid by the zone network; steady: where it would settle by that. As cool: the "
        "lightest that is as cool as the reference.",
        held=lambda row: row[0] == "reference",
    )


def _causes_table(run: HeatsinkResult) -> Table[tuple[str, float, float]]:
    """Return what each cause makes of the gain."""
    gain = run.gain
    causes = [(cause, min(ends), max(ends)) for cause, ends in gain.causes.items()]
    return Table(
        title="What the gain hangs on",
        columns=[
            Column("cause, between the ends of its interval of 90 %", lambda row: row[0]),
            Column("gain", lambda row: row[1], "K", ".1f"),
            Column("to", lambda row: row[2], "K", ".1f"),
        ],
        rows=[*causes, ("together", gain.low, gain.high)],
        held=lambda row: row[0] == "together",
    )


def _spread_table(run: HeatsinkResult) -> Table[Spread]:
    """Return what reference and coolest do by other laws of the fins."""
    first, last = run.drawing.surroundings.air_speed, run.spread[-1].air_speed
    draught = (
        "; the last is the draught that does to the reference what its factor does" if last > first else ""
    )
    return Table(
        title="By other laws of the fins",
        columns=[
            Column("law", lambda row: FIN_LAWS[row.correlation]),
            Column("times", "film_multiplier", form="g"),
            Column("air", "air_speed", "m/s", ".2g"),
            Column("reference", lambda row: _celsius(row.reference), "degC", ".1f"),
            Column("coolest", lambda row: _celsius(row.best), "degC", ".1f"),
            Column("difference", _cooler, "K", ".1f"),
        ],
        rows=run.spread,
        caption=f"By the zone network. The first line is what the search used{draught}.",
    )


def _cooler(row: Spread) -> float | None:
    return None if row.reference is None or row.best is None else row.reference - row.best


def _study_table(width: Sweep, fins: Sweep) -> Table[str]:
    """Return the paper's sweeps by every reading of its efficiency; a row is the name of one."""

    def value(sweep: Sweep, k: int, title: str) -> Column[str]:
        return Column(title, lambda name: float(sweep.values[name][k]), form=".4g")

    def trend(sweep: Sweep) -> Column[str]:
        said = lambda name: "yes" if sweep.follows_paper(name) else sweep.trend(name)  # noqa: E731
        return Column("as paper", said)

    star = {DEFAULT_EFFICIENCY: "*"}
    return Table(
        title="The paper's sweeps, by every reading of its efficiency (Eq. 10); * is the default",
        columns=[
            Column("efficiency", lambda name: f"{EFFICIENCIES[name].symbol}{star.get(name, '')}"),
            Column("formula", lambda name: EFFICIENCIES[name].formula, printed=False),
            Column("unit", lambda name: EFFICIENCIES[name].unit, printed=False),
            *(value(width, k, f"{1e3 * each.sink.width:.0f} mm") for k, each in enumerate(width.effects)),
            trend(width),
            *(value(fins, k, f"{each.sink.fins} fins") for k, each in enumerate(fins.effects)),
            trend(fins),
        ],
        rows=list(EFFICIENCIES),
        caption="The paper's Eq. (10) is lost. Marked: what peaks at 23 mm and at four fins, as the paper "
        "says. It fits the text and is no proof.",
        held=lambda name: width.follows_paper(name) and fins.follows_paper(name),
    )


def _varied_table(variation: Variation) -> Table[Json]:
    """Return what the sink does over the values of one of its numbers."""

    def cell(title: str, key: str, unit: str, form: str, scale: float = 1.0) -> Column[Json]:
        return Column(title, lambda row: scale * row[key], unit, form)

    return Table(
        title=f"The drawing's sink over {variation.key}, by the zone network",
        columns=[
            cell(variation.key, "value", "", "g"),
            cell("fluid", "temperature_degC", "degC", ".1f"),
            cell("bare", "bare_degC", "degC", ".1f"),
            cell("mass", "mass_kg", "g", ".1f", 1e3),
            cell("fin efficiency", "fin_efficiency", "", ".3f"),
        ],
        rows=_varied(variation),
    )


def _dampers(run: HeatsinkResult) -> list[tuple[str, DamperDrawing]]:
    """Return what is drawn: the reference, the best, and the lightest that is as cool as the reference."""

    def titled(name: str, design: SinkDesign) -> tuple[str, DamperDrawing]:
        words = "no fins" if design.sink is None else sink_in_words(design.sink)
        figures = f"{design.fluid - ZERO_CELSIUS_K:.1f} °C, {1e3 * design.mass:.0f} g"
        return f"{name}: {figures}\n{words}", run.drawing.with_sink(design.sink)

    chosen = [titled("reference", run.reference), titled("coolest", run.best)]
    if run.lightest is not None and run.reference.sink is not None and run.lightest is not run.best:
        chosen.append(titled("lightest that is as cool as the reference", run.lightest))
    return chosen


# ------------------------------------------------------------------------------------------- the answer


def _answer(run: HeatsinkResult) -> Json:
    """Return what ``mrdamper heatsink --json`` prints, but for the files."""
    limits, lightest = run.limits, run.lightest
    return {
        "duty": run.duty.text,
        "reference": _design(run.reference),
        "bare": _design(run.bare),
        "front": [_design(each) for each in run.front],
        "best": _design(run.best),
        "cooler_K": run.gain.middle,
        "cooler_interval_K": [run.gain.low, run.gain.high],
        "cooler_by_cause_K": {cause: list(ends) for cause, ends in run.gain.causes.items()},
        "better": run.gain.better,
        "lightest_as_cool": None if lightest is None else _design(lightest),
        "limits": {
            "span_m": limits.span,
            "width_m": limits.width,
            "mass_kg": limits.mass if limits.mass < float("inf") else None,
            "least_thickness_m": limits.least_thickness,
            "least_gap_m": limits.least_gap,
            "materials": [material.name for material in limits.materials],
            "emissivities": list(limits.emissivities),
        },
        "search": {
            "tried": run.found.tried,
            "outside": run.found.outside,
            "front": len(run.found.designs),
            "cpu_s": round(run.found.cpu_s, 3),
        },
        "spread": [
            {
                "correlation": each.correlation,
                "film_multiplier": each.film_multiplier,
                "air_m_s": each.air_speed,
                "reference_degC": _celsius(each.reference),
                "best_degC": _celsius(each.best),
            }
            for each in run.spread
        ],
        "varied": [{"key": each.key, "rows": _varied(each)} for each in run.varied],
        "study": None if run.sweeps is None else _study(run.sweeps),
        "notes": list(run.notes),
        "cpu_s": round(run.cpu_s, 3),
    }


def _design(design: SinkDesign) -> Json:
    """Return a design's line; the bare damper has no fins."""
    found = design.sink
    return {
        "fins": 0 if found is None else found.fins,
        "width_m": 0.0 if found is None else found.width,
        "thickness_m": 0.0 if found is None else found.thickness,
        "pitch_m": 0.0 if found is None else found.pitch,
        "mass_kg": design.mass,
        "temperature_degC": design.fluid - ZERO_CELSIUS_K,
        "model": design.model,
        "coil_degC": design.coil - ZERO_CELSIUS_K,
        "network_degC": design.network_fluid - ZERO_CELSIUS_K,
        "steady_degC": _celsius(design.steady),
        "material": None if found is None else found.material.name,
        "emissivity": None if found is None else found.emissivity,
    }


def _study(sweeps: tuple[Sweep, Sweep]) -> Json:
    width, fins = sweeps
    return {
        "default": DEFAULT_EFFICIENCY,
        "definitions": [
            {
                "name": name,
                "symbol": each.symbol,
                "formula": each.formula,
                "unit": each.unit,
                "width": width.trend(name),
                "fins": fins.trend(name),
                "follows_paper": {"width": width.follows_paper(name), "fins": fins.follows_paper(name)},
            }
            for name, each in EFFICIENCIES.items()
        ],
        "width": [_swept(width, k, effect) for k, effect in enumerate(width.effects)],
        "fins": [_swept(fins, k, effect) for k, effect in enumerate(fins.effects)],
    }


def _varied(variation: Variation) -> list[Json]:
    """Return a line for each value: temperatures with and without the sink, its mass and efficiencies."""
    efficiency = EFFICIENCIES[DEFAULT_EFFICIENCY].value
    return [
        {
            "value": value,
            "temperature_degC": effect.finned - ZERO_CELSIUS_K,
            "bare_degC": effect.bare - ZERO_CELSIUS_K,
            "mass_kg": effect.fin_mass,
            "fin_efficiency": effect.fin_efficiency,
            "efficiency_percent": efficiency(effect),
        }
        for value, effect in zip(variation.values, variation.effects, strict=True)
    ]


def _swept(sweep: Sweep, place: int, effect: SinkEffect) -> Json:
    return {
        "fins": effect.sink.fins,
        "width_m": effect.sink.width,
        "temperature_degC": effect.finned - ZERO_CELSIUS_K,
        "efficiency": {name: float(values[place]) for name, values in sweep.values.items()},
    }


def _celsius(kelvin: float | None) -> float | None:
    return None if kelvin is None else kelvin - ZERO_CELSIUS_K


def _toml(run: HeatsinkResult) -> str:
    """Return the best sink as a file for ``mrdamper heat --sink``."""
    best = run.best.sink
    assert best is not None  # a search returns sinks
    own = (("fins", best.fins), ("width_mm", 1e3 * best.width), ("thickness_mm", 1e3 * best.thickness))
    more = (
        ("pitch_mm", 1e3 * best.pitch),
        ("emissivity", best.emissivity),
        ("film_multiplier", best.film_multiplier),
        ("contact_m2K_W", best.contact),
    )
    lines = [f"{name} = {value:.10g}" for name, value in (*own, *more)]
    lines += [f'material = "{best.material.name}"', f'correlation = "{best.correlation}"']
    return "\n".join([f"# {sink_in_words(best)}", "[sink]", *lines, ""])


# ------------------------------------------------------------------------------------------- a terminal


def _show(run: HeatsinkResult, console: Console) -> None:
    """Print the front beside the reference, the paper's sweeps, and what a reader should know."""
    console.print(_front_table(run).printed(whole=True))
    console.print(f"[bold]{run.gain.middle:.1f} K[/bold] cooler than the reference{_banded(run)}")
    for each in run.spread:
        told = " and ".join(_degrees(kelvin) for kelvin in (each.reference, each.best))
        law = f"{each.correlation} law times {each.film_multiplier:g}"
        law += f" in air of {each.air_speed:.2g} m/s" if each.air_speed > 0.0 else ""
        console.print(f"  {law}: reference and coolest {told} degC (network)")
    for variation in run.varied:
        console.print(_varied_table(variation).printed())
    if run.sweeps is not None:
        console.print(_study_table(*run.sweeps).printed())
        for definition in EFFICIENCIES.values():
            console.print(escape(f"  {definition.symbol:4} {definition.formula} [{definition.unit}]"))
    print_notes(run.notes, console)


def _banded(run: HeatsinkResult) -> str:
    """Return the band of the gain in words, and whether the sink is better whatever the films are."""
    band = f", {run.gain.low:.1f} to {run.gain.high:.1f} K with 90 % over films and power"
    return band if run.gain.better else band + ": not surely better"


def _degrees(kelvin: float | None) -> str:
    return "-" if kelvin is None else f"{kelvin - ZERO_CELSIUS_K:.1f}"


def _rows(run: HeatsinkResult) -> list[Json]:
    return [_design(each) for each in run.front]


_PAGE = Page(
    name="heatsink.html",
    first=_first,
    picture=front_figure,
    label="Front of temperature against mass",
    sections=_sections,
)

REPORT = Report(
    answer=_answer,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="heatsink.json", key="file"),
        WrittenFile(name="front.csv", write=lambda run, path: write_table(path, _rows(run))),
        WrittenFile(name="best.toml", write=lambda run, path: path.write_text(_toml(run), encoding="utf-8")),
    ),
    curves=lambda run: {"listed": [_design(each) for _, each in _designs(run)]},
    rows=_rows,
)
