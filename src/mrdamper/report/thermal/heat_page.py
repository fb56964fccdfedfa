"""HTML page of the command ``heat``, and texts that the terminal output also uses."""

from __future__ import annotations

import math
from itertools import zip_longest
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.thermal.heat import HeatResult
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.damper_section import dampers_figure, field_figure
from mrdamper.report.figures.heat import fade_figure, paths_figure, temperature_figure
from mrdamper.report.identification.verdict import assumption_flags
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import Picture
from mrdamper.schema import json_value
from mrdamper.thermal.estimation.interval import PredictionInterval
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.limits import LimitReached
from mrdamper.thermal.model.heat_equation import FieldHeating
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.model.reduced import REDUCED_ORDER
from mrdamper.thermal.temperature_rise import Rise

_MODELS = {
    "reduced": f"finite elements, reduced to {REDUCED_ORDER} states",
    "network": "three axial zones",
    "lumped": "one node (the paper's Eq. 8)",
}


def _first(run: HeatResult) -> FirstScreen:
    rise, card, interval = run.rise, run.card, next(iter(page_intervals(run)), None)
    loss = rise.force_loss_percent
    minutes = f"{rise.time[-1] / 60:.4g} min"
    bare = "" if run.bare is None else f"without the heat sink {run.bare.fluid_degC[-1]:.1f} °C"
    hot = Tile(f"{rise.fluid_degC[-1]:.1f} °C", f"fluid after {minutes}", end_band(rise, interval) or bare)
    first = rise.first_limit
    label = (
        f"until the hottest point of the {first.limit.name} reaches its limit of {first.limit.celsius:.4g} °C"
    )
    time_left = Tile(reached(first), label, limit_band(interval, rise.limits.index(first)))
    fade = Tile("–" if loss is None else f"{loss:.1f} %", "loss of peak force since 20 °C", _peak_band(rise))
    return FirstScreen(
        title=f"Heating of {run.drawing.name}",
        subject=f"Card: {card.title or card.damper.law.name}. Load cycle: {run.duty.text}. "
        f"Thermal model: {_MODELS[rise.model]}.",
        verdict=_verdict(run),
        tiles=(hot, time_left, fade),
        caption=_caption(run),
        flags=temperature_flags(card),
        notes=run.notes,
    )


def _verdict(run: HeatResult) -> str:
    rise, first = run.rise, run.rise.first_limit
    minutes, hot = rise.time[-1] / 60, rise.fluid_degC[-1]
    hottest = f"{first.hottest - ZERO_CELSIUS_K:.1f} °C"
    limit = f"limit of {first.limit.celsius:.4g} °C"
    text = (
        f"No part reaches its limit in {minutes:.4g} min. The closest is the {first.limit.name} with a "
        f"{limit} and {hottest} at its hottest point"
    )
    if first.time_s is not None:
        text = f"The {first.limit.name} reaches the {limit} after {reached(first)}"
    if run.bare is None:
        return text
    cooler = run.bare.fluid_degC[-1] - hot
    return f"{text}. The heat sink lowers the final temperature of the fluid by {cooler:.1f} K"


def _caption(run: HeatResult) -> str:
    intervals = page_intervals(run)
    if not intervals:
        return ""
    source = (
        "It follows from assumed standard deviations because no curve was measured: power and heat capacity "
        "10 %, losses 25 %, inner conductances 30 %"
    )
    if run.calibrated is not None:
        source = "It is the uncertainty that remains after calibration with the measured curve"
        source += "" if run.bare is None else ". The curve does not apply without the heat sink"
    percent = f"{100 * intervals[0].probability:.0f} %"
    return (
        f"The band is the {percent} interval of the fluid temperature. The thick line is the {percent} "
        f"interval of the time to the limit. {source}"
    )


def temperature_flags(card: ModelCard) -> list[tuple[str, str]]:
    """Return a warning if the temperature dependence is missing or was assumed."""
    if card.damper.temperature_dependent:
        return assumption_flags(card.damper)
    return [("The card has no temperature model", "Force and mechanical power do not depend on temperature")]


def _sections(run: HeatResult) -> dict[str, object]:
    """Return the values that the page template prints below the first screen."""
    drawing = run.drawing
    title = "the damper" if drawing.sink is None else sink_in_words(drawing.sink)
    return {
        "rises": run.rises,
        "paths": Picture("Heat flows", lambda: paths_figure(run.rises)),
        "fade": Picture("Loss of force", lambda: fade_figure(run.rises)),
        "section": Picture("The damper to scale", lambda: dampers_figure([(title, drawing)])),
        "field": Picture("Temperature field at the end", lambda: _field_figure(run.rise)),
        "limits": [
            (title, limit_rows(rise, interval))
            for (title, rise), interval in zip_longest(run.rises, page_intervals(run))
        ],
        "probability": 100.0 * run.prediction_interval.probability,
        "account": [_account(rise) for _, rise in run.rises],
        "path_names": [path for path in PATHS if any(path in rise.energy_J for _, rise in run.rises)],
    }


def _figure(run: HeatResult) -> Figure:
    measured = None if run.calibrated is None else run.calibrated.curve
    return temperature_figure(run.rises, page_intervals(run), measured)


def _account(rise: Rise) -> dict[str, tuple[float, float]]:
    """Return each energy of the energy balance in kJ and as percentage of the supply."""
    energy, total = rise.energy_J, rise.input_J
    return {
        name: (joule / 1e3, 100.0 * joule / total if total > 0.0 else 0.0) for name, joule in energy.items()
    }


def sink_in_words(sink: HeatSink) -> str:
    """Return the dimensions of a heat sink as text: number of fins, width, thickness, pitch, material."""
    pitch = f" at {1e3 * sink.pitch:.3g} mm pitch" if sink.fins > 1 else ""
    fins = "fin" if sink.fins == 1 else "fins"
    return (
        f"{sink.fins} {fins}, {1e3 * sink.width:.3g} mm wide, {1e3 * sink.thickness:.3g} mm thick{pitch}, "
        f"{sink.material.name}"
    )


def page_intervals(run: HeatResult) -> list[PredictionInterval]:
    """Return the 90 % interval of each curve; empty if the damper model extrapolates."""
    return [] if run.extrapolated else run.prediction_intervals


def end_band(rise: Rise, interval: PredictionInterval | None, unit: str = "°C") -> str:
    """Return the interval of the final fluid temperature as text, or an empty string."""
    if interval is None:
        return ""
    nearest = int(np.argmin(np.abs(interval.time - rise.time[-1])))
    low, high = interval.low[nearest] - ZERO_CELSIUS_K, interval.high[nearest] - ZERO_CELSIUS_K
    return f"{100.0 * interval.probability:.0f} % interval {low:.1f} to {high:.1f} {unit}"


def _field_figure(rise: Rise) -> Figure | None:
    """Return a figure of the final temperature field; None for a network."""
    reduced, heating = rise.field, rise.heating
    if reduced is None or not isinstance(heating, FieldHeating):
        return None
    mesh = reduced.full.mesh
    corners = reduced.field(heating.state[-1])[: len(mesh.corners)] - ZERO_CELSIUS_K
    return field_figure(reduced.full.section, mesh, corners)


def limit_rows(rise: Rise, interval: PredictionInterval | None) -> list[dict[str, Any]]:
    """Return one row for each limit (fluid, coil, seals) with the temperature of the part's hottest point."""
    times = [None] * len(rise.limits) if interval is None else interval.to_limits
    return [
        {
            "part": each.limit.name,
            "limit_degC": each.limit.celsius,
            "source": each.limit.source,
            "hottest_degC": each.hottest - ZERO_CELSIUS_K,
            "time_s": each.time_s,
            "interval_s": None if to_limit is None else json_value([to_limit.low_s, to_limit.high_s]),
        }
        for each, to_limit in zip(rise.limits, times, strict=True)
    ]


def reached(limit: LimitReached) -> str:
    """Return the time to a temperature limit as text."""
    return "not reached" if limit.time_s is None else f"{limit.time_s / 60:.1f} min"


def limit_band(interval: PredictionInterval | None, index: int = 0) -> str:
    """Return the interval of the time to a temperature limit as text, or an empty string."""
    if interval is None or not math.isfinite((to_limit := interval.to_limits[index]).low_s):
        return ""
    high = f"to {to_limit.high_s / 60:.1f} min" if math.isfinite(to_limit.high_s) else "or longer"
    return f"{100 * interval.probability:.0f} % interval {to_limit.low_s / 60:.1f} min {high}"


def _peak_band(rise: Rise) -> str:
    first, last = rise.peak_force_N[0], rise.peak_force_N[-1]
    return f"{first:.0f} to {last:.0f} N" if math.isfinite(first) and math.isfinite(last) else ""


PAGE = Page(
    name="heat.html",
    first=_first,
    picture=_figure,
    label="Temperatures over time",
    template="heat.html.j2",
    values=_sections,
)
