"""What ``sink`` found: the answer's keys, tables of a terminal, the page, the front as CSV, the best sink."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mrdamper.jobs.thermal.sink import SinkResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import FirstScreen, Page, Report, Tile, WrittenFile, print_notes
from mrdamper.report.figures.damper_section import draw_dampers
from mrdamper.report.figures.sink import draw_sweeps, draw_varied, front_figure
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.heat_page import sink_in_words, temperature_flags
from mrdamper.runtime.outputs import write_table
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.heatsink import FIN_LAWS
from mrdamper.thermal.sinks.design import SinkDesign
from mrdamper.thermal.sinks.efficiency import DEFAULT_EFFICIENCY, EFFICIENCIES, SinkEffect, Sweep
from mrdamper.thermal.sinks.variation import Variation


def _first(run: SinkResult) -> FirstScreen:
    best, reference, limits = run.best, run.reference, run.limits
    judge = "finite elements" if best.model == "finite_element" else "the zone network"
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


def _spread_band(run: SinkResult) -> str:
    """Return what the fins' film coefficient leaves open, by the zone network."""
    found = [each.best for each in run.spread if each.best is not None]
    return f"{_degrees(min(found))} to {_degrees(max(found))} °C by other film laws" if len(found) > 1 else ""


def _lightest_band(run: SinkResult) -> str:
    if run.lightest is None or run.reference.sink is None or run.lightest is run.best:
        return ""
    return f"as cool as the reference: {1e3 * run.lightest.mass:.0f} g"


def _sections(run: SinkResult) -> dict[str, object]:
    return {
        "zero": ZERO_CELSIUS_K,
        "dampers": draw_dampers(_dampers(run), "Best sink and reference, to scale"),
        "sweeps": draw_sweeps(run),
        "varied": draw_varied(run),
        "laws": FIN_LAWS,
        "definitions": list(EFFICIENCIES.values()),
        "default": DEFAULT_EFFICIENCY,
        "judge": "finite elements" if run.best.model == "finite_element" else "the zone network",
    }


def _dampers(run: SinkResult) -> list[tuple[str, DamperDrawing]]:
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


def _answer(run: SinkResult) -> Json:
    """Return what ``mrdamper sink --json`` prints, but for the files."""
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


def _toml(run: SinkResult) -> str:
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


def _show(run: SinkResult, console: Console) -> None:
    """Print the front beside the reference, the paper's sweeps, and what a reader should know."""
    console.print(_front_table(run))
    console.print(f"[bold]{run.gain.middle:.1f} K[/bold] cooler than the reference{_banded(run)}")
    for each in run.spread:
        told = " and ".join(_degrees(kelvin) for kelvin in (each.reference, each.best))
        law = f"{each.correlation} law times {each.film_multiplier:g}"
        law += f" in air of {each.air_speed:.2g} m/s" if each.air_speed > 0.0 else ""
        console.print(f"  {law}: reference and coolest {told} degC (network)")
    for variation in run.varied:
        console.print(_varied_table(variation))
    if run.sweeps is not None:
        console.print(_study_table(*run.sweeps))
        for definition in EFFICIENCIES.values():
            console.print(escape(f"  {definition.symbol:4} {definition.formula} [{definition.unit}]"))
    print_notes(run.notes, console)


def _banded(run: SinkResult) -> str:
    """Return the band of the gain in words, and whether the sink is better whatever the films are."""
    band = f", {run.gain.low:.1f} to {run.gain.high:.1f} K with 90 % over films and power"
    return band if run.gain.better else band + ": not surely better"


def _varied_table(variation: Variation) -> Table:
    rows = (
        (
            f"{row['value']:g}", f"{row['temperature_degC']:.1f}", f"{row['bare_degC']:.1f}",
            f"{1e3 * row['mass_kg']:.1f}", f"{row['fin_efficiency']:.3f}",
        )
        for row in _varied(variation)
    )  # fmt: skip
    title = f"The drawing's sink over {variation.key}, by the zone network"
    return terminal_table(title, (variation.key, "degC", "bare degC", "g", "fin efficiency"), rows)


def _degrees(kelvin: float | None) -> str:
    return "-" if kelvin is None else f"{kelvin - ZERO_CELSIUS_K:.1f}"


def _front_table(run: SinkResult) -> Table:
    by = "finite elements" if run.best.model == "finite_element" else "zone network"
    designs = [("bare", run.bare)]
    if run.reference.sink is not None:
        designs.append(("reference", run.reference))
    designs += [("", design) for design in run.front[:-1]] + [("coolest", run.best)]
    rows = []
    for name, design in designs:
        sink = design.sink
        sizes = (0.0, 0.0, 0.0) if sink is None else (sink.width, sink.thickness, sink.pitch)
        known = 0 if sink is None else min(sink.fins, 2) + 1  # a single fin has no pitch
        cells = (f"{1e3 * size:.3g}" if k < known else "-" for k, size in enumerate(sizes))
        number, material = ("0", "") if sink is None else (str(sink.fins), sink.material.name)
        degrees = (_degrees(design.fluid), _degrees(design.network_fluid))
        rows.append((name, number, *cells, material, f"{1e3 * design.mass:.1f}", *degrees))
    title = f"Heat sinks: fluid at the end of the duty against mass, by {by}"
    names = ("", "fins", "width mm", "thickness mm", "pitch mm", "material", "g", "degC", "network degC")
    return terminal_table(title, names, rows, left=("", "material"), whole=True)


def _study_table(width: Sweep, fins: Sweep) -> Table:
    rows = []
    for name, definition in EFFICIENCIES.items():
        cells = []
        for sweep in (width, fins):
            cells += [f"{float(value):.4g}" for value in sweep.values[name]]
            cells.append("yes" if sweep.follows_paper(name) else sweep.trend(name))
        star = "*" if name == DEFAULT_EFFICIENCY else ""
        rows.append((f"{definition.symbol}{star}", *cells))
    title = "The paper's sweeps, by every reading of its efficiency (Eq. 10); * is the default"
    widths = [f"{1e3 * effect.sink.width:.0f} mm" for effect in width.effects]
    numbers = [f"{effect.sink.fins} fins" for effect in fins.effects]
    names = ("efficiency", *widths, "as paper", *numbers, "as paper")
    return terminal_table(title, names, rows, left=("efficiency", "as paper"))


def _rows(run: SinkResult) -> list[Json]:
    return [_design(each) for each in run.front]


_PAGE = Page(
    name="sink.html",
    first=_first,
    picture=front_figure,
    label="Front of temperature against mass",
    template="sink.html.j2",
    values=_sections,
)

REPORT = Report(
    answer=_answer,
    show=_show,
    page=_PAGE,
    files=(
        WrittenFile(name="sink.json", key="file"),
        WrittenFile(name="front.csv", write=lambda run, path: write_table(path, _rows(run))),
        WrittenFile(name="best.toml", write=lambda run, path: path.write_text(_toml(run), encoding="utf-8")),
    ),
    rows=_rows,
)
