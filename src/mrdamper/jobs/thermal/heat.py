"""The job ``heat``: card, drawing and duty in; temperatures, heat paths and force fade out.

A damper with a heat sink is run without it, too. A measured curve calibrates the drawing first. Where the
field is asked for, it is drawn at the end and at the worst moment.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeWarning, InputError
from mrdamper.identify.evaluate import beyond_in_words
from mrdamper.jobs.options import HeatOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_draws import PROBABILITY, draws_of, percentile_ends
from mrdamper.models.damper import Damper
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K, to_degC
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty, stroke_of
from mrdamper.thermal.estimation.calibration import CalibratedDrawing, calibrate_drawing
from mrdamper.thermal.estimation.interval import PredictionInterval, TimeToLimit, predict_interval
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.limits import limits_of, worst_moment
from mrdamper.thermal.model.finite_element import FieldModel, build_field
from mrdamper.thermal.model.heat_equation import FieldHeating, simulate_field
from mrdamper.thermal.model.network import loss_grid
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import loads_until
from mrdamper.thermal.temperature_rise import (
    Rise,
    beyond_card,
    loads_of,
    notes_of,
    simulate_rise,
    works_of,
)

_USUAL = HeatOptions()
_LONGEST_STEP_S = 60.0
_MOST_STEPS = 1500  # of the longest, in a duty that goes on for days
_MOST_CAPPED = 1.0  # beyond the card's temperatures, before it is said [K]


@dataclass(frozen=True, slots=True, eq=False)
class FieldMoment:
    """Temperatures everywhere at a time."""

    time: float  # [s]
    celsius: FloatArray  # at the mesh's corners [degC]


@dataclass(frozen=True, slots=True, eq=False)
class FieldEnd:
    """The temperature field at the end of a duty, and when a part was nearest to its limit."""

    model: FieldModel
    end: FieldMoment
    worst: FieldMoment | None  # None: that is the end
    fluid: float  # at the end [K]
    coil: float  # [K]
    wall: float  # [K]
    closure: float  # of the energy account [-]


@dataclass(frozen=True, slots=True, eq=False)
class PosteriorRise:
    """What the posterior draws of a card leave open of a rise: intervals of 90 %."""

    dampers: int  # that were followed
    low: FloatArray  # of the fluid, at the rise's times [K], shape (k,)
    high: FloatArray
    to_limits: tuple[TimeToLimit, ...]  # one for each of the rise's limits


@dataclass(frozen=True, slots=True, eq=False)
class HeatResult:
    """What ``mrdamper heat`` found, before it is put into words."""

    card: ModelCard
    drawing: DamperDrawing
    duty: Duty
    rise: Rise
    prediction_interval: PredictionInterval  # how sure it is
    bare: Rise | None  # without the sink; None when there is none
    bare_prediction_interval: PredictionInterval | None
    calibrated: CalibratedDrawing | None  # by a measured curve; ``drawing`` is then the calibrated one
    field: FieldEnd | None
    notes: tuple[str, ...]
    posterior: PosteriorRise | None = None  # where posterior draws are followed
    extrapolated: bool = False  # beyond the runs of the card: the intervals do not cover that

    @property
    def rises(self) -> list[tuple[str, Rise]]:
        """The runs with what to call them, the one that was asked for first."""
        if self.bare is None:
            return [("without heat sink", self.rise)]
        return [("with heat sink", self.rise), ("without heat sink", self.bare)]

    @property
    def prediction_intervals(self) -> list[PredictionInterval]:
        """How sure each of ``rises`` is."""
        return [
            each for each in (self.prediction_interval, self.bare_prediction_interval) if each is not None
        ]


def heat(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    options: HeatOptions = _USUAL,
    *,
    sink: HeatSink | None = None,
    calibrate: HeatingCurve | None = None,
    on_progress: Progress = silent,
) -> HeatResult:
    """Return the rise of a damper under a duty, with and without its sink, and how sure it is.

    Parameters
    ----------
    sink : takes the place of the drawing's
    calibrate : a curve that was measured from the duty's start on, with the sink that is asked for. The
        drawing is corrected by it first. Without its sink the damper keeps the uncertainty of one that
        nothing was measured of.

    Raises
    ------
    InputError
        A drawing that cannot be, a duty in another unit than the card's, a start beyond what is known of
        losses, no posterior draws of this card where they are asked for.
    EnvelopeError
        Temperatures or a correlation outside what is known.
    ConvergenceError
        A curve that this damper under this duty cannot follow.
    """
    posterior = draws_of(card, options.posterior)
    drawing, model = changed_drawing(drawing, options, sink), options.model
    drawing = replace(drawing, stroke=stroke_of(duty))
    start_given = start_of(drawing, options.start_degC)
    start = start_given
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        works = works_of(card.damper, duty)
    calibrated = None
    if calibrate is not None:
        calibrated = calibrate_drawing(calibrate, drawing, works, duty, model=model)
        drawing = calibrated.drawing
        start = calibrated.start_K if start is None else start
    step = max(_LONGEST_STEP_S, duty.duration / _MOST_STEPS)

    def rise_of(damper: DamperDrawing, by: list[LoopWork] = works, like: Rise | None = None) -> Rise:
        to_limit = not options.past_limit
        return simulate_rise(
            by, damper, duty, model=model, start_K=start, stop_at_limit=to_limit, longest_step=step, like=like
        )

    on_progress(ProgressUpdate(total=3, text="temperatures"))
    rise = rise_of(drawing)
    on_progress(ProgressUpdate(done=1, total=3, text="prediction interval"))
    prediction_interval = predict_interval(
        works, drawing, duty, rise, calibrated=calibrated, start_K=start_given
    )
    warm = _warm_notes(card, rise)
    extrapolated = bool(warm or beyond_card(card, duty))
    notes = [*notes_of(card, duty), *rise.notes, *warm]
    if extrapolated:
        form = "no interval is shown: it would not cover what lies beyond the card's runs"
        notes.append(Note("no_interval", form))
    told = dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning))
    notes += [Note("beyond_envelope", "{words}", words=words) for words in told]
    bare, bare_prediction_interval = None, None
    if drawing.sink is not None:
        alone = drawing.with_sink(None)
        bare = rise_of(alone)
        bare_prediction_interval = predict_interval(works, alone, duty, bare, start_K=start)
    field = None
    if options.by_field:
        on_progress(ProgressUpdate(done=2, total=3, text="temperature field"))
        field = _field_end(works, drawing, duty, rise, start, step)
    return HeatResult(
        card=card,
        drawing=drawing,
        duty=duty,
        rise=rise,
        prediction_interval=prediction_interval,
        bare=bare,
        bare_prediction_interval=bare_prediction_interval,
        calibrated=calibrated,
        field=field,
        notes=tuple(notes),
        posterior=_posterior_of(rise, posterior, duty, lambda works: rise_of(drawing, works, rise)),
        extrapolated=extrapolated,
    )


def _posterior_of(
    rise: Rise, dampers: Sequence[Damper], duty: Duty, rise_by: Callable[[list[LoopWork]], Rise]
) -> PosteriorRise | None:
    """Return the intervals that drawn dampers' rises span; one that ended at its limit stays there."""
    if not dampers:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EnvelopeWarning)  # the card's own damper has said it
        drawn = [rise_by(works_of(each, duty)) for each in dampers]
    low, high = percentile_ends(np.stack([np.interp(rise.time, each.time, each.fluid) for each in drawn]))
    times = np.array(
        [[math.inf if one.time_s is None else one.time_s for one in each.limits] for each in drawn]
    )
    tail = 0.5 * (1.0 - PROBABILITY)
    soonest, latest = np.quantile(times, (tail, 1.0 - tail), axis=0, method="nearest")
    to_limits = tuple(map(TimeToLimit, soonest.tolist(), latest.tolist()))
    return PosteriorRise(len(drawn), low, high, to_limits)


def changed_drawing(drawing: DamperDrawing, options: HeatOptions, sink: HeatSink | None) -> DamperDrawing:
    """Return the drawing with the sink and in the surroundings that were asked for."""
    around = drawing.surroundings
    if options.ambient_degC is not None:
        around = replace(around, ambient=options.ambient_degC + ZERO_CELSIUS_K)
    if options.air_m_s is not None:
        around = replace(around, air_speed=options.air_m_s)
    own = drawing.sink if options.with_sink else None
    return replace(drawing, surroundings=around, sink=sink or own)


def start_of(drawing: DamperDrawing, start_degC: float | None) -> float | None:
    """Return the temperature of everything at the start [K], where it was given."""
    if start_degC is None:
        return None
    start = start_degC + ZERO_CELSIUS_K
    low, high = loss_grid(drawing.surroundings.ambient)[[0, -1]]
    if not low <= start <= high:
        raise InputError(
            f"start temperature is {start_degC} degC",
            expected=f"{to_degC(low):.0f} to {to_degC(high):.0f} degC",
        )
    return start


def _field_end(
    works: list[LoopWork], drawing: DamperDrawing, duty: Duty, rise: Rise, start: float | None, step: float
) -> FieldEnd | None:
    """Return the field of a rise, by the reduced model where the rise has none; None at its start."""
    model, course = rise.field, rise.heating
    loads = loads_until(loads_of(works, drawing, duty), float(rise.time[-1]))
    if not loads:  # at the limit from the start
        return None
    if model is None or not isinstance(course, FieldHeating):
        model = reduce_field(build_field(drawing))
        course = simulate_field(model.equation, loads, start=start, longest_step=step)
    full, limits = model.full, limits_of(drawing)

    def moment(k: int) -> FieldMoment:
        corners = model.field(course.state[k])[: len(full.mesh.corners)]
        return FieldMoment(float(course.time[k]), np.asarray(corners - ZERO_CELSIUS_K))

    worst = worst_moment({each.part: course.hottest(each.part) for each in limits}, limits)
    last = len(course.time) - 1
    return FieldEnd(
        full,
        end=moment(last),
        worst=None if worst == last else moment(worst),
        fluid=float(course.fluid[-1]),
        coil=float(course.coil[-1]),
        wall=float(course.wall[-1]),
        closure=course.closure,
    )


def _warm_notes(card: ModelCard, rise: Rise) -> list[str]:
    """Say where the fluid leaves the temperatures that the card was identified at."""
    known = card.envelope.temperature
    if not card.damper.temperature_dependent or known is None:
        return []
    low, high = float(rise.fluid.min()), float(rise.fluid.max())
    if low > known[0] - _MOST_CAPPED and high < known[1] + _MOST_CAPPED:
        return []
    least, most, known_least, known_most = (kelvin - ZERO_CELSIUS_K for kelvin in (low, high, *known))
    return [
        Note(
            "beyond_temperature",
            "the fluid goes from {least_degC:.1f} to {most_degC:.1f} degC; the card was identified from "
            "{known_least_degC:.1f} to {known_most_degC:.1f} degC, {then}",
            least_degC=least,
            most_degC=most,
            known_least_degC=known_least,
            known_most_degC=known_most,
            then=beyond_in_words(card.damper),
        )
    ]
