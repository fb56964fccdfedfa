"""Quick heating curves and edited geometry files for web forms.

The thermal model is the model of ``mrdamper heat``. Card, geometry and intermediate results are cached for
the next curve. Temperature field and report are omitted. Therefore a form can request a curve after each
change.
"""

from __future__ import annotations

import math
import time
import warnings
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from mrdamper.errors import EnvelopeWarning
from mrdamper.excitation import Sine
from mrdamper.files import parse_toml, toml_text
from mrdamper.jobs.options import HeatOptions
from mrdamper.jobs.thermal.heat import changed_drawing, start_of
from mrdamper.models.card_schema import read_card
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.schema import Json, finite_or_none, read_record, write_record
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import DrawingTables, drawing_of, read_drawing, text_of
from mrdamper.thermal.duty import Duty, Segment, segment_of
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.sinks.design import HeatedDamper
from mrdamper.thermal.temperature_rise import Rise, card_range_notes, notes_of, simulate_rise, works_of

Value = TypeVar("Value")


class QuickHeat:
    """Computes successive heating curves and caches the data that they have in common."""

    def __init__(self) -> None:
        self._kept: OrderedDict[object, object] = OrderedDict()

    def curve(
        self,
        card: Path,
        damper: str,
        *,
        amplitude_mm: float = 15.0,
        frequency_Hz: float = 1.0,
        command: float = 2.0,
        duty_share: float = 1.0,
        duration_s: float = 1800.0,
        options: Mapping[str, Any] | None = None,
    ) -> Json:
        """Return the temperatures of a damper during a sinusoidal motion, as JSON values.

        Parameters
        ----------
        card : file of the model card
        damper : geometry file, or ``paper`` for the preset with this name
        duty_share : fraction of the time in operation; dissipated power and coil heat are averaged over
            operation and rest
        options : options of the job by the field names of ``HeatOptions``; None: the default options
        """
        asked = HeatOptions(**options or {})
        begin = time.perf_counter()
        model = self._keep(("card", *_version(card)), lambda: read_card(card))
        drawing = self._keep(("drawing", damper, *_version(Path(damper))), lambda: read_drawing(damper))
        drawing = changed_drawing(drawing, asked, None)
        unit = model.damper.command_unit
        duty = _duty(amplitude_mm, frequency_Hz, command, duration_s, unit)
        key = ("work", *_version(card), amplitude_mm, frequency_Hz, command)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", EnvelopeWarning)  # ``notes`` contains the text of these warnings.
            works = self._keep(key, lambda: works_of(model.damper, duty))
            notes, beyond = notes_of(model, duty), card_range_notes(model, duty)
            works = [replace(w, power=duty_share * w.power) for w in works]
            resting = tuple(replace(s, command=math.sqrt(duty_share) * s.command) for s in duty.segments)
            duty = replace(duty, segments=resting)
            rise = simulate_rise(
                works,
                drawing,
                duty,
                model=asked.model,
                start_K=start_of(asked),
                stop_at_limit=not asked.past_limit,
            )
        assumed = "by a fluid, not identified" if model.damper.assumed else ""
        outside = f"extrapolated: {', '.join(beyond)}" if beyond else ""
        return {
            "tiles": _tiles(rise, outside, assumed, tempered=model.damper.temperature_dependent),
            "curve": {
                "time_s": rise.time.tolist(),
                "hottest_degC": (rise.hot["gap"] - ZERO_CELSIUS_K).tolist(),
                "fluid_degC": rise.fluid_degC.tolist(),
                "coil_degC": rise.coil_degC.tolist(),
                "wall_degC": rise.wall_degC.tolist(),
                "peak_force_N": [finite_or_none(force) for force in rise.peak_force_N.tolist()],
            },
            "time_to_limit_s": rise.time_to_limit_s,
            "limit_degC": rise.limit_K - ZERO_CELSIUS_K,
            "force_loss_percent": None
            if rise.force_loss_percent is None
            else finite_or_none(rise.force_loss_percent),
            "power_W": {"mechanical": float(rise.mechanical_W[0]), "coil": float(rise.coil_W[0])},
            "notes": [*notes, *rise.notes],
            "computed_ms": round(1e3 * (time.perf_counter() - begin), 2),
        }

    def _keep(self, key: object, make: Callable[[], Value]) -> Value:
        if key not in self._kept:
            self._kept[key] = make()
        self._kept.move_to_end(key)
        while len(self._kept) > 64:
            self._kept.popitem(last=False)
        return self._kept[key]  # type: ignore[return-value]  # result of make


def _tiles(rise: Rise, outside: str, assumed: str, *, tempered: bool) -> list[Json]:
    """Return the main values of a heating curve as tiles: label, value and caveat."""
    minutes, left, loss = f"{rise.time[-1] / 60:.0f} min", rise.time_to_limit_s, rise.force_loss_percent
    reached = (
        f"not in {minutes}" if left is None else f"{left / 60:.3g} min" if left > 120 else f"{left:.0f} s"
    )
    known = loss is not None and math.isfinite(loss)
    caveats = "; ".join(filter(None, (assumed and f"assumed: {assumed}", outside)))
    rows = (
        ("time to the limit", reached, outside),
        (f"fluid after {minutes}", f"{rise.fluid_degC[-1]:.0f} °C", outside),
        ("coil", f"{rise.coil_degC[-1]:.0f} °C", outside),
        ("force lost by heating", f"{loss:.0f} %" if known else "–", caveats)
        if tempered
        else ("force lost by heating", "unknown", "the card has no temperature model"),
        ("heat at the start", f"{rise.mechanical_W[0] + rise.coil_W[0]:.3g} W", outside),
    )
    return [dict(zip(("label", "value", "mark"), row, strict=True)) for row in rows]


def damper_facts(damper: str, shown: str) -> Json:
    """Return the dimensions and the TOML tables of a geometry file."""
    return {**_facts(read_drawing(damper), shown), "tables": parse_toml(text_of(damper))}


def draw_damper(
    damper: str,
    shown: str,
    tables: Mapping[str, Mapping[str, Any]] | None = None,
    fins: Mapping[str, float | str] | None = None,
) -> Json:
    """Return the TOML text of a changed geometry file, and its main values.

    Parameters
    ----------
    damper, shown : original geometry file or preset; name of the file in messages
    tables : new content of all tables, by the field names of ``DrawingTables``; None: the original tables
    fins : design from the search for heat sinks, which replaces the table [sink]

    Raises
    ------
    InputError
        If the geometry is invalid. The message names the invalid table and key.
    """
    document: Json = parse_toml(text_of(damper))
    if tables is not None:
        document = {name: dict(table) for name, table in tables.items() if table}
        read_record(DrawingTables, document, shown)  # Unknown tables and keys are rejected.
    if fins is not None:
        drawing = drawing_of(toml_text(document, shown), shown)
        document["sink"] = write_record(_finned(drawing, fins), defaults=True)
    text = toml_text(document, shown)
    return {"text": text, "facts": _facts(drawing_of(text, shown), shown)}


def _facts(drawing: DamperDrawing, shown: str) -> Json:
    around, sink = drawing.surroundings, drawing.sink
    return {
        "name": shown,
        "ambient_degC": around.ambient - ZERO_CELSIUS_K,
        "air_m_s": around.air_speed,
        "calibration": _calibration(drawing, shown),
        "limit_degC": drawing.filling.valid_K[1] - ZERO_CELSIUS_K,
        "coil_resistance_ohm": drawing.coil.resistance,
        "outer_diameter_mm": 1e3 * drawing.body.outer_diameter,
        "length_mm": 1e3 * drawing.body.length,
        "wall_mm": 1e3 * drawing.body.wall,
        "cap_mm": 1e3 * drawing.body.cap,
        "piston_mm": [1e3 * drawing.piston.diameter, 1e3 * drawing.piston.length],
        "rod_mm": 1e3 * drawing.rod.diameter,
        "through": drawing.rod.through,
        "orientation": drawing.body.orientation,
        "sink": None
        if sink is None
        else {
            "fins": sink.fins,
            "width_mm": 1e3 * sink.width,
            "thickness_mm": 1e3 * sink.thickness,
            "pitch_mm": 1e3 * sink.pitch,
            "material": sink.material.name,
        },
    }


def _calibration(drawing: DamperDrawing, shown: str) -> str:
    """Return a sentence with the factors that were fitted to a measured damper; empty if there are none."""
    factors = {
        "heat capacity": drawing.calibration.heat_capacity,
        "convection of the body": drawing.calibration.film,
        "convection of the fins": 1.0 if drawing.sink is None else drawing.sink.film_multiplier,
    }
    known = ", ".join(f"{words} × {factor:.4g}" for words, factor in factors.items() if factor != 1.0)
    valid = "They hold for the damper on which they were measured."
    return known and f"{shown} contains calibration factors: {known}. {valid}"


def _finned(drawing: DamperDrawing, fins: Mapping[str, float | str]) -> HeatSink:
    """Return a heat sink with new fins and the original convection factor and contact."""
    own = HeatedDamper(drawing, ()).pattern
    sink = read_record(HeatSink, fins, "fins")
    return replace(sink, film_multiplier=own.film_multiplier, contact=own.contact)


def _duty(amplitude_mm: float, frequency_Hz: float, command: float, duration_s: float, unit: str) -> Duty:
    """Return the load cycle of a sine motion; for zero amplitude, a rest with current in the coil."""
    if amplitude_mm == 0.0:
        return Duty((Segment(duration_s, None, 0, abs(command)),), unit, f"rest at {command:g} {unit}")
    text = f"sine:{amplitude_mm:g}mm:{frequency_Hz:g}Hz:{command:g}{unit}:{duration_s:g}s"
    return Duty((segment_of(Sine(1e-3 * amplitude_mm, frequency_Hz), command, duration_s),), unit, text)


def _version(path: Path) -> tuple[str, int, int]:
    """Return path, modification time and size of a file, which change when the file changes."""
    try:
        found = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), found.st_mtime_ns, found.st_size
