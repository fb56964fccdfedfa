"""The job behind ``mrdamper heat``: card, drawing and duty in; curves, heat paths, force fade and a page out.

A damper with a heat sink is run without it, too. A measured curve calibrates the drawing first. With a folder
the temperatures at the end are also computed by finite elements where the extra ``[thermal]`` is installed.
Nothing is printed here.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeWarning, InputError, MissingExtraError
from mrdamper.identify.predict import beyond_in_words, finite
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.outputs import atomic_output, write_json, write_table
from mrdamper.schema import Json
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing, read_drawing, read_sink
from mrdamper.thermal.drawing_file import calibrated_text, text_of
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.estimation.calibration import CalibratedDrawing, calibrate_with
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, read_curve
from mrdamper.thermal.estimation.prediction_interval import predict_interval
from mrdamper.thermal.estimation.uncertainty import ModelUncertainty, PredictionInterval
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.finite_element import FieldModel, heat_field
from mrdamper.thermal.model.network import loss_grid
from mrdamper.thermal.model.stepping import loads_until
from mrdamper.thermal.temperature_rise import Model, Rise, loads_of, notes_of, simulate_rise, works_of

__all__ = ["FieldEnd", "HeatOptions", "HeatRun", "heat", "heat_damper", "sink_in_words", "write_heat"]

_LONGEST_STEP_S = 60.0
_MOST_STEPS = 1500  # of the longest, in a duty that goes on for days
_MOST_CAPPED = 1.0  # beyond the card's temperatures, before it is said [K]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """How ``mrdamper heat`` runs."""

    past_limit: bool = False  # go on beyond the fluid's limit, instead of ending there
    model: Model = "zones"
    start_degC: float | None = None  # of everything; None: ambient, or the calibration's


@dataclass(frozen=True, slots=True, eq=False)
class FieldEnd:
    """The finite elements at the end of a duty."""

    model: FieldModel
    time: float  # [s]
    celsius: FloatArray  # at the mesh's corners [degC]
    fluid: float  # [K]
    coil: float  # [K]
    wall: float  # [K]
    closure: float  # of the energy account [-]


@dataclass(frozen=True, slots=True, eq=False)
class HeatRun:
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
    card: Path,
    damper: Path,
    *,
    duty: str = DEFAULT_DUTY,
    sink: Path | None = None,
    calibrate: Path | None = None,
    options: HeatOptions | None = None,
    out: Path | None = None,
) -> Json:
    """Heat a damper through a duty; with ``out`` write heat.html, heat.json and heat.csv there.

    Parameters
    ----------
    card : the model card
    damper : the drawing (TOML)
    duty : ``MOTION:COMMAND:DURATION`` or a CSV file
    sink : a file with a table [sink] that takes the place of the drawing's
    calibrate : a curve (CSV) that was measured from the duty's start on, with the sink that is asked for; the
        drawing that follows it goes to calibrated.toml

    Raises
    ------
    InputError
        A file that cannot be read, a drawing that cannot be, a duty in another unit than the card's.
    EnvelopeError
        Temperatures or a correlation outside what is known.
    ConvergenceError
        A curve that this damper under this duty cannot follow.
    """
    drawing = read_drawing(damper)
    if sink is not None:
        drawing = drawing.with_sink(read_sink(sink))
    chosen = options or HeatOptions()
    run = heat_damper(
        read_card(card),
        drawing,
        read_duty(duty),
        past_limit=chosen.past_limit,
        model=chosen.model,
        start_degC=chosen.start_degC,
        by_field=out is not None,
        measured=None if calibrate is None else read_curve(calibrate),
    )
    if out is None:
        return {"card": str(card), "damper": str(damper), **_answer(run)}
    with atomic_output(out) as beside:
        answer = write_heat(run, card, damper, beside, out)
        if run.calibrated is not None:
            text = calibrated_text(
                text_of(damper),
                run.calibrated.entries,
                f"{Path(damper).name}, calibrated by {run.calibrated.curve.name}",
                sink_text=None if sink is None else text_of(sink),
            )
            (beside / "calibrated.toml").write_text(text, encoding="utf-8")
            answer["drawing"] = str(out / "calibrated.toml")
        return answer


def write_heat(run: HeatRun, card: Path, damper: str | Path, beside: Path, out: Path) -> Json:
    """Write heat.html, heat.json and heat.csv into ``beside``, of what will lie in ``out``."""
    from mrdamper.report.heat import render_heat

    files = {"report": str(out / "heat.html"), "file": str(out / "heat.json")}
    answer: Json = {"card": str(card), "damper": str(damper), **_answer(run), **files}
    (beside / "heat.html").write_text(render_heat(run), encoding="utf-8")
    write_json(beside / "heat.json", answer)
    write_table(beside / "heat.csv", _rows(run))
    return answer


def heat_damper(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    *,
    past_limit: bool = False,
    model: Model = "zones",
    start_degC: float | None = None,
    by_field: bool = False,
    measured: HeatingCurve | None = None,
) -> HeatRun:
    """Return the rise of a damper, with and without its sink, and the finite elements if asked for.

    A ``measured`` curve calibrates the drawing first. It was measured with the sink: without it the damper
    keeps the doubt about one that nothing was measured of.
    """
    start_given = None if start_degC is None else start_degC + ZERO_CELSIUS_K
    low, high = loss_grid(drawing.surroundings.ambient)[[0, -1]]
    if start_given is not None and not low <= start_given <= high:
        raise InputError(
            f"start temperature is {start_degC} degC; expected {low - ZERO_CELSIUS_K:.0f} to "
            f"{high - ZERO_CELSIUS_K:.0f} degC"
        )
    start = start_given
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        works = works_of(card.damper, duty)
    calibrated = None
    if measured is not None:
        calibrated = calibrate_with(
            measured, drawing, works, duty, model=model, model_uncertainty=ModelUncertainty()
        )
        drawing = calibrated.drawing
        start = calibrated.numbers.start_K if start is None else start
    step = max(_LONGEST_STEP_S, duty.duration / _MOST_STEPS)

    def rise_of(damper: DamperDrawing, notes: tuple[str, ...] = ()) -> Rise:
        return simulate_rise(
            works,
            damper,
            duty,
            model=model,
            start_K=start,
            stop_at_limit=not past_limit,
            longest_step=step,
            notes=notes,
        )

    rise = rise_of(drawing, notes_of(card, duty))
    prediction_interval = predict_interval(
        works, drawing, duty, calibrated=calibrated, model=model, start_K=start_given
    )
    notes = [*rise.notes, *_warm_notes(card, rise)]
    notes += dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning))
    bare, bare_prediction_interval = None, None
    if drawing.sink is not None:
        alone = drawing.with_sink(None)
        bare = rise_of(alone)
        bare_prediction_interval = predict_interval(works, alone, duty, model=model, start_K=start)
    field = None
    if by_field:
        try:
            field = _field_end(works, drawing, duty, rise, start, step)
        except MissingExtraError as fault:
            notes.append(f"no temperature field: {fault}")
    return HeatRun(
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
    )


def _field_end(
    works: list[LoopWork], drawing: DamperDrawing, duty: Duty, rise: Rise, start: float | None, step: float
) -> FieldEnd | None:
    """Return the finite elements at the end of the network's curve, wherever that ends; None at its start."""
    loads = loads_until(loads_of(works, drawing, duty), float(rise.time[-1]))
    if not loads:  # at the limit from the start
        return None
    field, course = heat_field(drawing, loads, start_K=start, longest_step=step)
    corners = course.state[-1][: len(field.mesh.corners)] + course.equation.ambient - ZERO_CELSIUS_K
    return FieldEnd(
        field,
        float(course.time[-1]),
        np.asarray(corners),
        float(course.fluid[-1]),
        float(course.coil[-1]),
        float(course.wall[-1]),
        course.closure,
    )


def _warm_notes(card: ModelCard, rise: Rise) -> list[str]:
    """Say where the fluid leaves the temperatures that the card was identified at."""
    known = card.envelope.temperature
    if not card.damper.temperature_dependent or known is None:
        return []
    low, high = float(rise.fluid.min()), float(rise.fluid.max())
    if low > known[0] - _MOST_CAPPED and high < known[1] + _MOST_CAPPED:
        return []
    told = [f"{kelvin - ZERO_CELSIUS_K:.1f}" for kelvin in (low, high, *known)]
    return [
        f"the fluid goes from {told[0]} to {told[1]} degC; the card was identified from {told[2]} to "
        f"{told[3]} degC, {beyond_in_words(card.damper)}"
    ]


def sink_in_words(sink: HeatSink) -> str:
    """Return a sink in a few words: number, width, thickness, pitch, material."""
    pitch = f" at {1e3 * sink.pitch:.3g} mm pitch" if sink.fins > 1 else ""
    fins = "fin" if sink.fins == 1 else "fins"
    return (
        f"{sink.fins} {fins}, {1e3 * sink.width:.3g} mm wide, {1e3 * sink.thickness:.3g} mm thick{pitch}, "
        f"{sink.material.name}"
    )


# ------------------------------------------------------------------------------------------- the answer


def _answer(run: HeatRun) -> Json:
    """Return what ``mrdamper heat --json`` prints, but for the files."""
    rise, drawing, card = run.rise, run.drawing, run.card
    field = run.field
    return {
        "duty": run.duty.text,
        "model": rise.model,
        **_course(rise, run.prediction_interval),
        "limit_degC": rise.limit_K - ZERO_CELSIUS_K,
        "ripple_K": finite(rise.ripple_K),
        "correlations": dict(rise.correlations),
        "tempered": card.damper.temperature_dependent,
        "assumed": list(card.damper.assumed),
        "sink": None if drawing.sink is None else sink_in_words(drawing.sink),
        "without_sink": None
        if run.bare is None or run.bare_prediction_interval is None
        else _course(run.bare, run.bare_prediction_interval),
        "calibration": None if run.calibrated is None else _calibration(run.calibrated),
        "finite_element": None
        if field is None
        else {
            "time_s": field.time,
            "fluid_degC": field.fluid - ZERO_CELSIUS_K,
            "coil_degC": field.coil - ZERO_CELSIUS_K,
            "wall_degC": field.wall - ZERO_CELSIUS_K,
            "nodes": len(field.model.nodes),
            "energy_closure": field.closure,
        },
        "notes": list(run.notes),
    }


def _calibration(calibrated: CalibratedDrawing) -> Json:
    numbers, curve = calibrated.numbers, calibrated.curve
    return {
        "curve": curve.name,
        "place": curve.place,
        "from_s": float(curve.time[0]),
        "to_s": float(curve.time[-1]),
        "power_over_capacity_K_s": numbers.power_over_capacity,
        "power_over_capacity_error_K_s": numbers.power_error,
        "conductance_over_capacity_1_s": numbers.conductance_over_capacity,
        "conductance_over_capacity_error_1_s": numbers.conductance_error,
        "correlation": numbers.correlation,
        "at_degC": numbers.at_K - ZERO_CELSIUS_K,
        "start_degC": numbers.start_K - ZERO_CELSIUS_K,
        "residual_K": numbers.residual_K,
        "noise_K": numbers.noise_K,
        "entries": {table: dict(entries) for table, entries in calibrated.entries.items()},
        "words": list(numbers.words),
    }


def _course(rise: Rise, prediction_interval: PredictionInterval) -> Json:
    to_limit = prediction_interval.to_limit
    return {
        "curve": {
            "time_s": rise.time.tolist(),
            "fluid_degC": rise.fluid_degC.tolist(),
            "coil_degC": rise.coil_degC.tolist(),
            "wall_degC": rise.wall_degC.tolist(),
        },
        "energy_closure": rise.energy_closure,
        "time_to_limit_s": rise.time_to_limit_s,
        "time_to_limit_interval_s": [
            time if math.isfinite(time) else None for time in (to_limit.low_s, to_limit.high_s)
        ],
        "interval": {
            "probability": prediction_interval.probability,
            "time_s": prediction_interval.time.tolist(),
            "median_degC": (prediction_interval.median - ZERO_CELSIUS_K).tolist(),
            "low_degC": (prediction_interval.low - ZERO_CELSIUS_K).tolist(),
            "high_degC": (prediction_interval.high - ZERO_CELSIUS_K).tolist(),
            "limit_not_reached": to_limit.not_reached,
        },
        "force_loss_percent": rise.force_loss_percent,
        "peak_force_N": [finite(force) for force in rise.peak_force_N.tolist()],
        "power_W": {"mechanical": rise.mechanical_W.tolist(), "coil": rise.coil_W.tolist()},
        "paths_W": {path: watts.tolist() for path, watts in rise.paths_W.items()},
        "energy_J": dict(rise.energy_J),
    }


def _rows(run: HeatRun) -> list[dict[str, object]]:
    """Return the curve as a table, one row for each time."""
    rise = run.rise
    columns: dict[str, FloatArray] = {
        "time_s": rise.time,
        "fluid_degC": rise.fluid_degC,
        "coil_degC": rise.coil_degC,
        "wall_degC": rise.wall_degC,
        "peak_force_N": rise.peak_force_N,
        "mechanical_W": rise.mechanical_W,
        "coil_W": rise.coil_W,
        **{f"{path.replace(' ', '_')}_W": watts for path, watts in rise.paths_W.items()},
    }
    return [
        {name: None if np.isnan(values[k]) else float(f"{values[k]:.9g}") for name, values in columns.items()}
        for k in range(len(rise.time))
    ]
