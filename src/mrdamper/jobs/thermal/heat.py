"""The job ``heat``: compute temperatures, heat flows and loss of force in a load cycle.

A damper with a heat sink is also computed without it. A measured curve first calibrates the geometry. If the
temperature field is requested, it is plotted at the end and at the hottest time.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

from mrdamper.errors import EnvelopeWarning
from mrdamper.identify.evaluate import describe_extrapolation
from mrdamper.jobs.options import HeatOptions
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty, stroke_of
from mrdamper.thermal.estimation.calibration import CalibratedDrawing, calibrate_drawing
from mrdamper.thermal.estimation.interval import PredictionInterval, predict_interval
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.temperature_rise import (
    Rise,
    card_range_notes,
    notes_of,
    simulate_rise,
    works_of,
)

_USUAL = HeatOptions()
_LONGEST_STEP_S = 60.0
_MOST_STEPS = 1500  # Max steps of the longest output step in load cycles of several days.
_MOST_CAPPED = 1.0  # A larger excess above the temperatures of the card is reported [K].


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HeatResult(JobResult):
    """Result of ``mrdamper heat``."""

    _job = "heat"
    card: ModelCard
    drawing: DamperDrawing
    duty: Duty
    rise: Rise
    prediction_interval: PredictionInterval  # uncertainty of the result
    bare: Rise | None  # without the sink; None if there is no sink
    bare_prediction_interval: PredictionInterval | None
    # calibration by a measured curve; ``drawing`` is then the calibrated geometry
    calibrated: CalibratedDrawing | None
    notes: tuple[str, ...]
    extrapolated: bool = False  # True outside the runs of the card; the intervals do not cover this.

    @property
    def rises(self) -> list[tuple[str, Rise]]:
        """Return the runs with their names, the requested one first."""
        if self.bare is None:
            return [("without heat sink", self.rise)]
        return [("with heat sink", self.rise), ("without heat sink", self.bare)]

    @property
    def prediction_intervals(self) -> list[PredictionInterval]:
        """Return the prediction interval of each of ``rises``."""
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
    """Return the temperature rise of a damper in a load cycle with its uncertainty, with and without sink.

    Parameters
    ----------
    sink : replaces the sink of the geometry file
    calibrate : measured temperature curve from the start of the load cycle, with the requested sink, for a
        calibration of the geometry. The damper without sink keeps the uncertainty without calibration.

    Raises
    ------
    InputError
        If the geometry is invalid, load cycle and card have different units, or the start is out of range.
    EnvelopeError
        If a temperature or a correlation is outside its valid range.
    ConvergenceError
        If the damper cannot follow the curve in this load cycle.
    """
    drawing, model = changed_drawing(drawing, options, sink), options.model
    drawing = replace(drawing, stroke=stroke_of(duty))
    start_given = start_of(options)
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

    def rise_of(damper: DamperDrawing) -> Rise:
        to_limit = not options.past_limit
        return simulate_rise(
            works, damper, duty, model=model, start_K=start, stop_at_limit=to_limit, longest_step=step
        )

    on_progress(ProgressUpdate(total=2, text="temperatures"))
    rise = rise_of(drawing)
    on_progress(ProgressUpdate(done=1, total=2, text="prediction interval"))
    prediction_interval = predict_interval(
        works, drawing, duty, rise, calibrated=calibrated, start_K=start_given
    )
    warm = _warm_notes(card, rise)
    extrapolated = bool(warm or card_range_notes(card, duty))
    notes = [*notes_of(card, duty), *rise.notes, *warm]
    if extrapolated:
        notes.append("no interval is shown: it would not cover what lies beyond the card's runs")
    told = dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning))
    notes += [f"{words}" for words in told]
    bare, bare_prediction_interval = None, None
    if drawing.sink is not None:
        alone = drawing.with_sink(None)
        bare = rise_of(alone)
        bare_prediction_interval = predict_interval(works, alone, duty, bare, start_K=start)
    return HeatResult(
        card=card,
        drawing=drawing,
        duty=duty,
        rise=rise,
        prediction_interval=prediction_interval,
        bare=bare,
        bare_prediction_interval=bare_prediction_interval,
        calibrated=calibrated,
        notes=tuple(notes),
        extrapolated=extrapolated,
    )


def changed_drawing(drawing: DamperDrawing, options: HeatOptions, sink: HeatSink | None) -> DamperDrawing:
    """Return the geometry with the requested sink and surroundings."""
    around = drawing.surroundings
    if options.ambient_degC is not None:
        around = replace(around, ambient=options.ambient_degC + ZERO_CELSIUS_K)
    if options.air_m_s is not None:
        around = replace(around, air_speed=options.air_m_s)
    own = drawing.sink if options.with_sink else None
    return replace(drawing, surroundings=around, sink=sink or own)


def start_of(options: HeatOptions) -> float | None:
    """Return the initial temperature of the damper [K], if it is given."""
    return None if options.start_degC is None else options.start_degC + ZERO_CELSIUS_K


def _warm_notes(card: ModelCard, rise: Rise) -> list[str]:
    """Return notes if the fluid is outside the temperatures of the card's identification."""
    known = card.envelope.temperature
    if not card.damper.temperature_dependent or known is None:
        return []
    low, high = float(rise.fluid.min()), float(rise.fluid.max())
    if low > known[0] - _MOST_CAPPED and high < known[1] + _MOST_CAPPED:
        return []
    least, most, known_least, known_most = (kelvin - ZERO_CELSIUS_K for kelvin in (low, high, *known))
    return [
        (
            f"the fluid goes from {least:.1f} to {most:.1f} degC; the card was identified from "
            f"{known_least:.1f} to {known_most:.1f} degC, {describe_extrapolation(card.damper)}"
        )
    ]
