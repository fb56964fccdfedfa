"""The job behind ``mrdamper heat``: card, drawing and duty in; curves, heat paths, force fade and a page out.

A damper with a heat sink is run without it, too. With a folder the temperatures at the end are also computed
by finite elements where the extra ``[thermal]`` is installed. Nothing is printed here.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.app.answers import Json
from mrdamper.app.api import finite
from mrdamper.app.outputs import staged, write_json, write_table
from mrdamper.errors import EnvelopeWarning, InputError, MissingExtraError
from mrdamper.models.card import ModelCard
from mrdamper.models.card_reading import read_card
from mrdamper.quantities import FloatArray
from mrdamper.thermal.drawing import DamperDrawing, read_drawing, read_sink
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.finite_element import FieldModel, heat_field
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.rise import Model, Rise, heat_with, loads_of, predict_rise, works_of
from mrdamper.thermal.work import LoopWork

__all__ = ["FieldEnd", "HeatRun", "heat", "heat_damper", "sink_in_words"]

_ZERO_CELSIUS_K = 273.15
_MOST_CAPPED = 1.0  # beyond the card's temperatures, before it is said [K]


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
    bare: Rise | None  # without the sink; None when there is none
    field: FieldEnd | None
    notes: tuple[str, ...]

    @property
    def rises(self) -> list[tuple[str, Rise]]:
        """The runs with what to call them, the one that was asked for first."""
        if self.bare is None:
            return [("without heat sink", self.rise)]
        return [("with heat sink", self.rise), ("without heat sink", self.bare)]


def heat(
    card: Path,
    damper: Path,
    *,
    duty: str = DEFAULT_DUTY,
    sink: Path | None = None,
    out: Path | None = None,
    past_limit: bool = False,
    model: Model = "zones",
    start_degC: float | None = None,
) -> Json:
    """Heat a damper through a duty; with ``out`` write heat.html, heat.json and heat.csv there.

    Parameters
    ----------
    card : the model card
    damper : the drawing (TOML)
    duty : ``MOTION:COMMAND:DURATION`` or a CSV file
    sink : a file with a table [sink] that takes the place of the drawing's
    past_limit : go on beyond the fluid's limit, instead of ending there
    model : ``zones`` or ``lumped``
    start_degC : of everything at the start; None: ambient

    Raises
    ------
    InputError
        A file that cannot be read, a drawing that cannot be, a duty in another unit than the card's.
    EnvelopeError
        Temperatures or a correlation outside what is known.
    """
    drawing = read_drawing(damper)
    if sink is not None:
        drawing = drawing.with_sink(read_sink(sink))
    run = heat_damper(
        read_card(card),
        drawing,
        read_duty(duty),
        past_limit=past_limit,
        model=model,
        start_degC=start_degC,
        by_field=out is not None,
    )
    answer = {"card": str(card), "damper": str(damper), **_answer(run)}
    if out is not None:
        from mrdamper.app.heat_page import render_heat

        answer |= {"report": str(out / "heat.html"), "file": str(out / "heat.json")}
        page = render_heat(run)
        with staged(out) as beside:
            (beside / "heat.html").write_text(page, encoding="utf-8")
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
) -> HeatRun:
    """Return the rise of a damper, with and without its sink, and the finite elements if asked for."""
    start = None if start_degC is None else start_degC + _ZERO_CELSIUS_K
    if start is not None and not start > 0.0:
        raise InputError(f"start temperature is {start_degC} degC; expected a temperature above -273.15 degC")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        rise = predict_rise(card, drawing, duty, model=model, start_K=start, stop_at_limit=not past_limit)
        works = works_of(card.damper, duty)
    notes = [*rise.notes, *_warm_notes(card, rise)]
    notes += dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning))
    bare = None
    if drawing.sink is not None:
        bare = heat_with(
            works, drawing.with_sink(None), duty, model=model, start_K=start, stop_at_limit=not past_limit
        )
    field = None
    if by_field:
        try:
            field = _field_end(works, drawing, duty, rise, start)
        except MissingExtraError as fault:
            notes.append(f"no temperature field: {fault}")
    return HeatRun(card, drawing, duty, rise, bare, field, tuple(notes))


def _field_end(
    works: list[LoopWork], drawing: DamperDrawing, duty: Duty, rise: Rise, start: float | None
) -> FieldEnd | None:
    """Return the finite elements at the end of the network's curve, wherever that ends; None at its start."""
    loads, left = [], float(rise.time[-1])
    for load in loads_of(works, drawing, duty):
        if left <= 1e-9:
            break
        loads.append(type(load)(min(load.duration, left), load.power, load.coil_W))
        left -= load.duration
    if not loads:  # at the limit from the start
        return None
    field, course = heat_field(drawing, loads, start_K=start)
    corners = course.state[-1][: len(field.mesh.corners)] + course.equation.ambient - _ZERO_CELSIUS_K
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
    if not card.damper.tempered or known is None:
        return []
    low, high = float(rise.fluid.min()), float(rise.fluid.max())
    if low > known[0] - _MOST_CAPPED and high < known[1] + _MOST_CAPPED:
        return []
    told = [f"{kelvin - _ZERO_CELSIUS_K:.1f}" for kelvin in (low, high, *known)]
    return [
        f"the fluid goes from {told[0]} to {told[1]} degC; the card was identified from {told[2]} to "
        f"{told[3]} degC, and 5 K beyond that its force is held at the edge's"
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
        **_course(rise),
        "limit_degC": rise.limit_K - _ZERO_CELSIUS_K,
        "ripple_K": finite(rise.ripple_K),
        "correlations": dict(rise.correlations),
        "tempered": card.damper.tempered,
        "assumed": list(card.damper.assumed),
        "sink": None if drawing.sink is None else sink_in_words(drawing.sink),
        "without_sink": None if run.bare is None else _course(run.bare),
        "finite_element": None
        if field is None
        else {
            "time_s": field.time,
            "fluid_degC": field.fluid - _ZERO_CELSIUS_K,
            "coil_degC": field.coil - _ZERO_CELSIUS_K,
            "wall_degC": field.wall - _ZERO_CELSIUS_K,
            "nodes": len(field.model.nodes),
            "energy_closure": field.closure,
        },
        "notes": list(run.notes),
    }


def _course(rise: Rise) -> Json:
    return {
        "curve": {
            "time_s": rise.time.tolist(),
            "fluid_degC": rise.fluid_degC.tolist(),
            "coil_degC": rise.coil_degC.tolist(),
            "wall_degC": rise.wall_degC.tolist(),
        },
        "energy_closure": rise.energy_closure,
        "time_to_limit_s": rise.time_to_limit_s,
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
