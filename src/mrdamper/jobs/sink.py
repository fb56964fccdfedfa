"""The job behind ``mrdamper sink``: card, drawing, limits in; heat sinks and the paper's sweeps out.

The zone network searches; the members of the front that are shown, and the reference, are judged again by
finite elements where the extra ``[thermal]`` is installed. Nothing is printed here.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from mrdamper.errors import InputError, MissingExtraError
from mrdamper.identify.fit import versions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import card_text, read_card
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.heat import sink_in_words
from mrdamper.runtime.checkpoint import Tell, checkpointed
from mrdamper.runtime.outputs import atomic_output, write_json, write_table
from mrdamper.runtime.progress import ProgressUpdate
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.heatsink import FinLaw
from mrdamper.thermal.materials import find_material
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    Memory,
    SinkDesign,
    SinkFront,
    SinkLimits,
    Spread,
    confirm,
    front_of,
    lightest_as_cool,
    limits_of,
    search_grid,
    spread,
    thinned,
)
from mrdamper.thermal.sinks.efficiency import (
    DEFAULT_EFFICIENCY,
    EFFICIENCIES,
    SinkEffect,
    Sweep,
    paper_sweeps,
)
from mrdamper.thermal.sinks.evolution import search_genetic
from mrdamper.thermal.temperature_rise import loads_of, notes_of, works_of

if TYPE_CHECKING:
    from mrdamper.report.figures.sink import SinkPictures

__all__ = ["Method", "SinkOptions", "SinkRun", "search_sinks", "sink", "write_sink"]

Method = Literal["grid", "nsga2"]

_WIDE_APART = 3.0  # between network and finite elements, before it is said [K]


Report = Callable[[int, int, str], None]
"""Receives how many are done, how many there are, and what comes now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkOptions:
    """What ``mrdamper sink`` can be told; None: as the drawing's own sink has it."""

    span_mm: float | None = None
    width_mm: float | None = None
    mass_g: float | None = None
    least_thickness_mm: float = 1.0
    least_gap_mm: float = 3.0
    materials: tuple[str, ...] = ()
    emissivities: tuple[float, ...] = ()
    correlation: str | None = None
    film_multiplier: float | None = None
    method: Method = "grid"
    members: int = 12  # of the front, that are shown and judged again
    by_field: bool = True
    seed: int = 0

    def limits(self, drawing: DamperDrawing) -> SinkLimits:
        """Return the limits in SI for a damper."""

        def metres(value: float | None) -> float | None:
            return None if value is None else value / 1e3

        return limits_of(
            drawing,
            span=metres(self.span_mm),
            width=metres(self.width_mm),
            mass=metres(self.mass_g),
            least_thickness=self.least_thickness_mm / 1e3,
            least_gap=self.least_gap_mm / 1e3,
            materials=[find_material(name, "--material") for name in self.materials],
            emissivities=self.emissivities,
        )


@dataclass(frozen=True, slots=True, eq=False)
class SinkRun:
    """What ``mrdamper sink`` found, before it is put into words."""

    drawing: DamperDrawing
    duty: Duty
    limits: SinkLimits
    bare: SinkDesign
    reference: SinkDesign  # the drawing's own sink, or the bare damper
    found: SinkFront  # all of it, by the network
    front: tuple[SinkDesign, ...]  # what is shown of it
    spread: tuple[Spread, ...]
    sweeps: tuple[Sweep, Sweep] | None
    card: ModelCard
    notes: tuple[str, ...]
    cpu_s: float

    @property
    def best(self) -> SinkDesign:
        """The coolest."""
        return self.front[-1]

    @property
    def lightest(self) -> SinkDesign | None:
        """The lightest that is as cool as the reference."""
        return lightest_as_cool(self.front, self.reference.fluid)


def sink(
    card: Path,
    damper: Path,
    *,
    duty: str = DEFAULT_DUTY,
    options: SinkOptions | None = None,
    out: Path | None = None,
    resume: bool | None = None,
    tell: Tell | None = None,
    report: Report | None = None,
) -> Json:
    """Search heat sinks for a damper; with ``out`` write sink.html, sink.json, front.csv and best.toml there.

    ``resume`` goes on with what a search for the same had finished; False begins anew, but keeps what is
    finished; None keeps nothing. ``tell`` is told what is done with an earlier search's progress.

    Raises
    ------
    InputError
        A file that cannot be read, limits that no sink keeps to, a duty in another unit than the card's.
    EnvelopeError
        Temperatures or a correlation outside what is known.
    """
    drawing = read_drawing(damper)
    chosen = options or SinkOptions()
    model, load = read_card(card), read_duty(duty)
    if out is None:
        if resume:
            raise InputError("⟦--resume⟧ goes on with what is kept beside ⟦--out⟧; expected an ⟦--out⟧")
        run = search_sinks(model, drawing, load, chosen, report=report)
        return {"card": str(card), "damper": str(damper), **_answer(run, chosen)}
    head = {} if resume is None else _decisive(model, drawing, load, chosen)
    with checkpointed(out, head, resume=resume, tell=tell) as kept:
        with atomic_output(out) as beside:
            run = search_sinks(model, drawing, load, chosen, report=report, memory=kept)
            answer = write_sink(run, chosen, card, damper, beside, out)
        if kept is not None:
            kept.finished = True
        return answer


def _decisive(card: ModelCard, drawing: DamperDrawing, duty: Duty, options: SinkOptions) -> Json:
    """Return all that decides what a search comes to; progress is taken up only where this is the same."""

    def digest(text: str) -> str:
        return hashlib.sha256(text.encode()).hexdigest()

    return {
        "job": "sink",
        "program": versions(),
        "card": digest(card_text(card)),
        "damper": digest(repr(drawing)),
        "duty": _duty_digest(duty),
        "options": {key: value for key, value in asdict(options).items() if key != "seed"},
        "seed": options.seed,
    }


def _duty_digest(duty: Duty) -> str:
    digest = hashlib.sha256(f"{duty.text}\0{duty.command_unit}".encode())
    for each in duty.segments:
        digest.update(f"\0{each.duration!r} {each.counted_from} {each.command!r}".encode())
        if each.path is not None:
            for track in (each.path.displacement, each.path.velocity, each.path.command):
                digest.update(np.ascontiguousarray(track, dtype="<f8").data)
    return digest.hexdigest()


def write_sink(
    run: SinkRun,
    options: SinkOptions,
    card: Path,
    damper: str | Path,
    beside: Path,
    out: Path,
    *,
    pictures: SinkPictures | None = None,
) -> Json:
    """Write sink.html, sink.json, front.csv and best.toml into ``beside``, of what will lie in ``out``."""
    from mrdamper.report.figures.sink import SinkPictures
    from mrdamper.report.sink import render_sink

    files = {"report": str(out / "sink.html"), "file": str(out / "sink.json")}
    answer: Json = {"card": str(card), "damper": str(damper), **_answer(run, options), **files}
    (beside / "sink.html").write_text(render_sink(pictures or SinkPictures(run)), encoding="utf-8")
    write_json(beside / "sink.json", answer)
    write_table(beside / "front.csv", [_design(each) for each in run.front])
    (beside / "best.toml").write_text(_toml(run), encoding="utf-8")
    return answer


def search_sinks(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    options: SinkOptions,
    *,
    report: Report | None = None,
    memory: Memory | None = None,
) -> SinkRun:
    """Return the front of a search, its reference and the paper's sweeps.

    A ``memory`` recalls and keeps what was tried.
    """

    def on_progress(update: ProgressUpdate) -> None:
        if report is not None:
            report(update.done, update.total or 0, update.text)

    clock = time.process_time()
    drawing = _with_law(drawing, options)
    limits = options.limits(drawing)
    works = works_of(card.damper, duty)
    heated = HeatedDamper(drawing, tuple(loads_of(works, drawing, duty)))
    bare = heated.evaluate(None)
    reference = bare if drawing.sink is None else heated.evaluate(drawing.sink)
    if options.method == "grid":
        found = search_grid(heated, limits, on_progress=on_progress, memory=memory)
    else:
        found = search_genetic(heated, limits, seed=options.seed, on_progress=on_progress, memory=memory)
    shown: Sequence[SinkDesign] = thinned(found.designs, options.members)
    notes = _notes(card, duty, drawing, limits, found)
    if options.by_field:
        try:
            judged = confirm(heated, (bare, reference, *shown), on_progress=on_progress, memory=memory)
        except MissingExtraError as fault:
            notes.append(f"not judged by finite elements: {fault}")
        else:
            bare, reference, shown = judged[0], judged[1], front_of(judged[2:])
            apart = max(abs(each.fluid - each.network_fluid) for each in judged)
            if apart > _WIDE_APART:
                notes.append(f"network and finite elements are up to {apart:.1f} K apart")
    try:
        sweeps = paper_sweeps(drawing, heated.pattern, heated.loads)
    except InputError as fault:
        sweeps = None
        notes.append(f"the paper's sweeps are left out, its fins do not go with this damper: {fault}")
    limit = drawing.filling.valid_K[1]
    if shown[-1].fluid > limit:
        notes.append(
            f"no sink keeps the fluid below its limit, {limit - ZERO_CELSIUS_K:.4g} degC: the coolest is at "
            f"{shown[-1].fluid - ZERO_CELSIUS_K:.1f}"
        )
    best = shown[-1].sink
    assert best is not None  # a search returns sinks
    return SinkRun(
        drawing=drawing,
        duty=duty,
        limits=limits,
        bare=heated.settled(bare),
        reference=heated.settled(reference),
        found=found,
        front=tuple(heated.settled(each) for each in shown),
        spread=spread(heated, drawing.sink, best),
        sweeps=sweeps,
        card=card,
        notes=tuple(notes),
        cpu_s=time.process_time() - clock,
    )


def _with_law(drawing: DamperDrawing, options: SinkOptions) -> DamperDrawing:
    """Return a drawing whose sink convects as the options say."""
    if options.correlation is None and options.film_multiplier is None:
        return drawing
    pattern = HeatedDamper(drawing, ()).pattern
    law = cast("FinLaw", options.correlation or pattern.correlation)
    factor = pattern.film_multiplier if options.film_multiplier is None else options.film_multiplier
    changed = replace(pattern, correlation=law, film_multiplier=factor)
    if drawing.sink is None:
        raise InputError(
            f"{drawing.name}: ⟦--correlation⟧ and ⟦--film-multiplier⟧ change the drawing's own sink, and it "
            "has none; give it a table [sink]"
        )
    return drawing.with_sink(changed)


def _notes(
    card: ModelCard, duty: Duty, drawing: DamperDrawing, limits: SinkLimits, found: SinkFront
) -> list[str]:
    notes = list(notes_of(card, duty))
    if found.outside:
        notes.append(
            f"{found.outside} of {found.tried} sinks are outside the range of a correlation, left out"
        )
    own, best = drawing.sink, found.best.sink
    if own is not None and own.film_multiplier != 1.0:
        notes.append(
            f"the fins' film coefficient is {own.film_multiplier:g} times the correlation's, as drawn; that "
            "this factor holds at narrower gaps is an assumption (see the spread)"
        )
    if best is not None and best.thickness <= limits.least_thickness * (1.0 + 1e-6):
        notes.append("the best fins are as thin as can be made: the least thickness decides")
    return notes


# ------------------------------------------------------------------------------------------- the answer


def _answer(run: SinkRun, options: SinkOptions) -> Json:
    """Return what ``mrdamper sink --json`` prints, but for the files."""
    limits, lightest = run.limits, run.lightest
    return {
        "duty": run.duty.text,
        "reference": _design(run.reference),
        "bare": _design(run.bare),
        "front": [_design(each) for each in run.front],
        "best": _design(run.best),
        "cooler_K": run.reference.fluid - run.best.fluid,
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
            "method": run.found.method,
            "seed": options.seed,
            "tried": run.found.tried,
            "outside": run.found.outside,
            "front": len(run.found.designs),
            "cpu_s": round(run.found.cpu_s, 3),
        },
        "spread": [
            {
                "correlation": each.correlation,
                "film_multiplier": each.film_multiplier,
                "reference_degC": _celsius(each.reference),
                "best_degC": _celsius(each.best),
            }
            for each in run.spread
        ],
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


def _swept(sweep: Sweep, place: int, effect: SinkEffect) -> Json:
    return {
        "fins": effect.sink.fins,
        "width_m": effect.sink.width,
        "temperature_degC": effect.finned - ZERO_CELSIUS_K,
        "efficiency": {name: float(values[place]) for name, values in sweep.values.items()},
    }


def _celsius(kelvin: float | None) -> float | None:
    return None if kelvin is None else kelvin - ZERO_CELSIUS_K


def _toml(run: SinkRun) -> str:
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
