"""The job ``heat``: compute temperatures, heat flows and loss of force in a load cycle.

A damper with a heat sink is also computed without the heat sink. If a measured heating curve is given, the
geometry is calibrated first. A requested temperature field is plotted at the last time and at the time of the
maximum temperature.
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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HeatResult(JobResult):
    """Result of ``heat``: temperature rise with uncertainty, with and without heat sink."""

    _job = "heat"
    card: ModelCard
    drawing: DamperDrawing
    duty: Duty
    rise: Rise
    prediction_interval: PredictionInterval  # uncertainty of ``rise``
    bare: Rise | None  # temperature rise without heat sink; None if the damper has no heat sink
    bare_prediction_interval: PredictionInterval | None
    # Result of the calibration with a measured heating curve. ``drawing`` is then the calibrated geometry.
    calibrated: CalibratedDrawing | None
    notes: tuple[str, ...]
    # True if the load cycle is outside the range of the card's runs. The intervals ignore the extrapolation.
    extrapolated: bool = False

    @property
    def rises(self) -> list[tuple[str, Rise]]:
        """Return the temperature rise with and without heat sink, each with its name."""
        if self.bare is None:
            return [("without heat sink", self.rise)]
        return [("with heat sink", self.rise), ("without heat sink", self.bare)]

    @property
    def prediction_intervals(self) -> list[PredictionInterval]:
        """Return the prediction intervals in the order of ``rises``."""
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
    """Return the temperature rise of a damper in a load cycle, with its uncertainty.

    A damper with a heat sink is simulated twice, with and without the heat sink.

    Parameters
    ----------
    sink : heat sink that replaces the heat sink in the geometry file; None: no replacement
    calibrate : temperatures that were measured in this load cycle with the requested heat sink, for the
        calibration of the geometry. The calibration does not reduce the uncertainty of the simulation without
        heat sink.

    Raises
    ------
    InputError
        If the geometry is invalid, load cycle and card have different units, or the initial temperature is
        out of range.
    EnvelopeError
        If a temperature or a correlation is outside its valid range.
    ConvergenceError
        If no calibrated geometry reproduces the measured curve in this load cycle.
    """
    longest_step_s = 60.0
    most_steps = 1500  # max number of time steps; for long load cycles, the longest step is increased
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
    step = max(longest_step_s, duty.duration / most_steps)

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
    """Return the geometry with the requested heat sink, ambient temperature and air speed."""
    around = drawing.surroundings
    if options.ambient_degC is not None:
        around = replace(around, ambient=options.ambient_degC + ZERO_CELSIUS_K)
    if options.air_m_s is not None:
        around = replace(around, air_speed=options.air_m_s)
    own = drawing.sink if options.with_sink else None
    return replace(drawing, surroundings=around, sink=sink or own)


def start_of(options: HeatOptions) -> float | None:
    """Return the requested initial temperature of the damper [K]; None: the ambient temperature."""
    return None if options.start_degC is None else options.start_degC + ZERO_CELSIUS_K


def _warm_notes(card: ModelCard, rise: Rise) -> list[str]:
    """Return a note if the fluid is colder or hotter than in all runs of the card."""
    most_capped = 1.0  # A note requires a temperature farther outside the range [K].
    known = card.envelope.temperature
    if not card.damper.temperature_dependent or known is None:
        return []
    low, high = float(rise.fluid.min()), float(rise.fluid.max())
    if low > known[0] - most_capped and high < known[1] + most_capped:
        return []
    least, most, known_least, known_most = (kelvin - ZERO_CELSIUS_K for kelvin in (low, high, *known))
    return [
        (
            f"the fluid goes from {least:.1f} to {most:.1f} degC; the card was identified from "
            f"{known_least:.1f} to {known_most:.1f} degC, {describe_extrapolation(card.damper)}"
        )
    ]
