"""The job ``heatsink``: find heat sinks with low fluid temperature and low mass.

The job also repeats two studies (fin width, number of fins) of the paper that the program reproduces. The
search uses the fast thermal network of axial zones. The displayed designs of the front and the reference
design are evaluated again with finite elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatsinkOptions
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.results import JobResult
from mrdamper.runtime.pool import cpu_seconds
from mrdamper.runtime.progress import Progress, silent
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.materials import find_material
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
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
from mrdamper.thermal.sinks.effects import GainBand, Sweep, gain_band, paper_sweeps
from mrdamper.thermal.temperature_rise import loads_of, notes_of, works_of

DEFAULT_OPTIONS = HeatsinkOptions()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HeatsinkResult(JobResult):
    """The Pareto front of a search, the reference design, and the parameter studies of the paper."""

    _job = "heatsink"
    drawing: DamperDrawing
    duty: Duty
    limits: SinkLimits
    bare: SinkDesign  # damper without heat sink
    reference: SinkDesign  # damper with its original heat sink, or ``bare`` if there is no heat sink
    found: SinkFront  # whole Pareto front, evaluated with the thermal network
    front: tuple[SinkDesign, ...]  # displayed designs of the front
    gain: GainBand  # fluid temperature of ``reference`` minus the coolest design, with its uncertainty
    sweeps: tuple[Sweep, Sweep] | None
    card: ModelCard
    notes: tuple[str, ...]
    cpu_s: float

    @property
    def best(self) -> SinkDesign:
        """Return the coolest design."""
        return self.front[-1]

    @property
    def lightest(self) -> SinkDesign | None:
        """Return the lightest design that is not warmer than the reference."""
        return lightest_as_cool(self.front, self.reference.fluid)


def heatsink(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    options: HeatsinkOptions = DEFAULT_OPTIONS,
    *,
    on_progress: Progress = silent,
) -> HeatsinkResult:
    """Search for the heat sinks with the lowest fluid temperature in a load cycle.

    Raises
    ------
    InputError
        If no sink is within the limits, or the load cycle and the card have different units.
    EnvelopeError
        If a temperature or a correlation is outside its valid range.
    """
    clock = cpu_seconds()
    limits = _limits(drawing, options)
    heated = HeatedDamper(drawing, tuple(loads_of(works_of(card.damper, duty), drawing, duty)))
    bare = heated.evaluate(None)
    reference = bare if drawing.sink is None else heated.evaluate(drawing.sink)
    found = search_grid(heated, limits, on_progress=on_progress)
    shown: Sequence[SinkDesign] = thinned(found.designs, options.members)
    notes = _notes(card, duty, drawing, limits, found)
    if options.by_field:
        judged = confirm(heated, (bare, reference, *shown), on_progress=on_progress)
        bare, reference, shown = judged[0], judged[1], front_of(judged[2:])
        notes += _model_difference(judged)
    sweeps = _sweeps(heated, notes)
    notes += _too_hot(shown[-1], drawing)
    best = shown[-1].sink
    assert best is not None  # All designs of a search have sinks.
    return HeatsinkResult(
        drawing=drawing,
        duty=duty,
        limits=limits,
        bare=bare,
        reference=reference,
        found=found,
        front=tuple(shown),
        gain=gain_band(heated, drawing.sink, best, reference.fluid - shown[-1].fluid),
        sweeps=sweeps,
        card=card,
        notes=tuple(notes),
        cpu_s=cpu_seconds() - clock,
    )


def _limits(drawing: DamperDrawing, options: HeatsinkOptions) -> SinkLimits:
    """Return the limits of the search in SI units; missing limits are taken from the geometry."""

    def scaled(value: float | None) -> float | None:
        return None if value is None else value / 1e3

    return limits_of(
        drawing,
        span=scaled(options.span_mm),
        width=scaled(options.width_mm),
        mass=scaled(options.mass_g),
        materials=[find_material(name, "--material") for name in options.materials],
    )


def _sweeps(heated: HeatedDamper, notes: list[str]) -> tuple[Sweep, Sweep] | None:
    try:
        return paper_sweeps(heated.drawing, heated.pattern, heated.loads)
    except InputError as fault:
        form = "the paper's sweeps are omitted because its fins do not fit on this damper: {why}"
        notes.append(form.format(why=f"{fault}"))
        return None


def _model_difference(judged: Sequence[SinkDesign]) -> list[str]:
    model_difference_max_K = 3.0  # A note reports a larger difference between network and finite elements.
    apart = max(abs(each.fluid - each.network_fluid) for each in judged)
    if apart <= model_difference_max_K:
        return []
    return [f"network and finite elements differ by up to {apart:.1f} K"]


def _too_hot(coolest: SinkDesign, drawing: DamperDrawing) -> list[str]:
    limit = drawing.filling.valid_K[1]
    if coolest.fluid <= limit:
        return []
    return [
        (
            f"no sink keeps the fluid below its limit, {limit - ZERO_CELSIUS_K:.4g} degC: the "
            f"coolest is at {coolest.fluid - ZERO_CELSIUS_K:.1f}"
        )
    ]


def _notes(
    card: ModelCard, duty: Duty, drawing: DamperDrawing, limits: SinkLimits, found: SinkFront
) -> list[str]:
    notes: list[str] = list(notes_of(card, duty))
    if found.outside:
        notes.append(
            f"{found.outside} of {found.tried} sinks are outside the range of a correlation and were omitted"
        )
    own, best = drawing.sink, found.best.sink
    if own is not None and own.film_multiplier != 1.0:
        notes.append(
            f"the fins' heat-transfer coefficient is {own.film_multiplier:g} times the correlation's, as in "
            "the geometry file; that this factor holds at narrower gaps is an assumption"
        )
    if best is not None and best.thickness <= limits.least_thickness * (1.0 + 1e-6):
        notes.append("the best fins are as thin as can be made: the smallest thickness decides")
    return notes
