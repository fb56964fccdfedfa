"""The job ``heatsink``: card, drawing, limits in; heat sinks and the paper's sweeps out.

The zone network searches; the members of the front that are shown, and the reference, are judged again by
finite elements where the extra ``[thermal]`` is installed. A search can be taken up where it ended.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from mrdamper.errors import InputError, option
from mrdamper.identify.fit import versions
from mrdamper.jobs.options import HeatsinkOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import card_text
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.pool import Pool, cpu_seconds
from mrdamper.runtime.progress import Progress, silent
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.heatsink import FinLaw
from mrdamper.thermal.materials import find_material
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    Memory,
    SinkDesign,
    SinkFront,
    SinkLimits,
    confirm,
    front_of,
    lightest_as_cool,
    limits_of,
    search_grid,
    thinned,
)
from mrdamper.thermal.sinks.efficiency import Sweep, paper_sweeps
from mrdamper.thermal.sinks.gain import GainBand, Spread, gain_band, spread
from mrdamper.thermal.sinks.variation import Variation, vary
from mrdamper.thermal.temperature_rise import loads_of, notes_of, works_of

_USUAL = HeatsinkOptions()
_WIDE_APART = 3.0  # between network and finite elements, before it is said [K]


@dataclass(frozen=True, slots=True, eq=False)
class HeatsinkResult:
    """The front of a search, its reference, and the paper's sweeps."""

    drawing: DamperDrawing
    duty: Duty
    limits: SinkLimits
    bare: SinkDesign
    reference: SinkDesign  # the drawing's own sink, or the bare damper
    found: SinkFront  # all of it, by the network
    front: tuple[SinkDesign, ...]  # what is shown of it
    gain: GainBand  # of the coolest over the reference
    spread: tuple[Spread, ...]
    varied: tuple[Variation, ...]
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


def heatsink(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    options: HeatsinkOptions = _USUAL,
    *,
    checkpoint: Memory | None = None,
    on_progress: Progress = silent,
) -> HeatsinkResult:
    """Search heat sinks for a damper; a ``checkpoint`` recalls and keeps what was tried.

    Raises
    ------
    InputError
        Limits that no sink keeps to, a duty in another unit than the card's.
    EnvelopeError
        Temperatures or a correlation outside what is known.
    """
    clock = cpu_seconds()
    drawing = _with_law(drawing, options)
    limits = _limits(drawing, options)
    works = works_of(card.damper, duty)
    heated = HeatedDamper(drawing, tuple(loads_of(works, drawing, duty)))
    varied = tuple(vary(drawing, said, works, duty) for said in options.vary)
    bare = heated.evaluate(None)
    reference = bare if drawing.sink is None else heated.evaluate(drawing.sink)
    pool = Pool(options.jobs)
    found = search_grid(heated, limits, on_progress=on_progress, memory=checkpoint, pool=pool)
    shown: Sequence[SinkDesign] = thinned(found.designs, options.members)
    notes = _notes(card, duty, drawing, limits, found)
    if options.by_field:
        designs = (bare, reference, *shown)
        judged = confirm(heated, designs, on_progress=on_progress, memory=checkpoint, pool=pool)
        bare, reference, shown = judged[0], judged[1], front_of(judged[2:])
        notes += _apart(judged)
    sweeps = _sweeps(heated, notes)
    notes += _too_hot(shown[-1], drawing)
    best = shown[-1].sink
    assert best is not None  # a search returns sinks
    return HeatsinkResult(
        drawing=drawing,
        duty=duty,
        limits=limits,
        bare=heated.settled(bare),
        reference=heated.settled(reference),
        found=found,
        front=tuple(heated.settled(each) for each in shown),
        gain=gain_band(heated, drawing.sink, best, reference.fluid - shown[-1].fluid),
        spread=spread(heated, drawing.sink, best),
        varied=varied,
        sweeps=sweeps,
        card=card,
        notes=tuple(notes),
        cpu_s=cpu_seconds() - clock,
    )


def _limits(drawing: DamperDrawing, options: HeatsinkOptions) -> SinkLimits:
    """Return the limits in SI for a damper."""

    def metres(value: float | None) -> float | None:
        return None if value is None else value / 1e3

    return limits_of(
        drawing,
        span=metres(options.span_mm),
        width=metres(options.width_mm),
        mass=metres(options.mass_g),
        least_thickness=metres(options.least_thickness_mm),
        least_gap=metres(options.least_gap_mm),
        materials=[find_material(name, option("material")) for name in options.materials],
        emissivities=options.emissivities,
    )


def _sweeps(heated: HeatedDamper, notes: list[str]) -> tuple[Sweep, Sweep] | None:
    try:
        return paper_sweeps(heated.drawing, heated.pattern, heated.loads)
    except InputError as fault:
        form = "the paper's sweeps are left out, its fins do not go with this damper: {why}"
        notes.append(Note("no_paper_sweeps", form, why=f"{fault}"))
        return None


def _apart(judged: Sequence[SinkDesign]) -> list[str]:
    apart = max(abs(each.fluid - each.network_fluid) for each in judged)
    form = "network and finite elements are up to {apart_K:.1f} K apart"
    return [Note("models_apart", form, apart_K=apart)] if apart > _WIDE_APART else []


def _too_hot(coolest: SinkDesign, drawing: DamperDrawing) -> list[str]:
    limit = drawing.filling.valid_K[1]
    if coolest.fluid <= limit:
        return []
    return [
        Note(
            "all_too_hot",
            "no sink keeps the fluid below its limit, {limit_degC:.4g} degC: the coolest is at "
            "{coolest_degC:.1f}",
            limit_degC=limit - ZERO_CELSIUS_K,
            coolest_degC=coolest.fluid - ZERO_CELSIUS_K,
        )
    ]


def decisive(card: ModelCard, drawing: DamperDrawing, duty: Duty, options: HeatsinkOptions) -> Json:
    """Return all that decides what a search comes to; progress is taken up only where this is the same."""

    def digest(text: str) -> str:
        return hashlib.sha256(text.encode()).hexdigest()

    return {
        "job": "heatsink",
        "program": versions(),
        "card": digest(card_text(card)),
        "damper": digest(repr(drawing)),
        "duty": _duty_digest(duty),
        "options": {key: value for key, value in asdict(options).items() if key != "jobs"},
    }


def _duty_digest(duty: Duty) -> str:
    digest = hashlib.sha256(f"{duty.text}\0{duty.command_unit}".encode())
    for each in duty.segments:
        digest.update(f"\0{each.duration!r} {each.counted_from} {each.command!r}".encode())
        if each.path is not None:
            for track in (each.path.displacement, each.path.velocity, each.path.command):
                digest.update(np.ascontiguousarray(track, dtype="<f8").data)
    return digest.hexdigest()


def _with_law(drawing: DamperDrawing, options: HeatsinkOptions) -> DamperDrawing:
    """Return a drawing whose sink convects as the options say."""
    if options.correlation is None and options.film_multiplier is None:
        return drawing
    pattern = HeatedDamper(drawing, ()).pattern
    law: FinLaw = options.correlation or pattern.correlation
    factor = pattern.film_multiplier if options.film_multiplier is None else options.film_multiplier
    changed = replace(pattern, correlation=law, film_multiplier=factor)
    if drawing.sink is None:
        raise InputError(
            f"{option('correlation')} and {option('film-multiplier')} change the drawing's own sink, and it "
            "has none",
            place=drawing.name,
            remedy="give it a table [sink]",
        )
    return drawing.with_sink(changed)


def _notes(
    card: ModelCard, duty: Duty, drawing: DamperDrawing, limits: SinkLimits, found: SinkFront
) -> list[str]:
    notes: list[str] = list(notes_of(card, duty))
    if found.outside:
        form = "{outside} of {tried} sinks are outside the range of a correlation, left out"
        notes.append(Note("outside_correlation", form, outside=found.outside, tried=found.tried))
    own, best = drawing.sink, found.best.sink
    if own is not None and own.film_multiplier != 1.0:
        form = (
            "the fins' film coefficient is {factor:g} times the correlation's, as drawn; that this factor "
            "holds at narrower gaps is an assumption (see the spread)"
        )
        notes.append(Note("film_multiplier", form, factor=own.film_multiplier))
    if best is not None and best.thickness <= limits.least_thickness * (1.0 + 1e-6):
        form = "the best fins are as thin as can be made: the least thickness decides"
        notes.append(Note("least_thickness_decides", form, thickness_mm=1e3 * best.thickness))
    return notes
