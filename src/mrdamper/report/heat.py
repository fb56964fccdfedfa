"""The page of ``mrdamper heat``: one HTML file that opens offline, as the report does."""

from __future__ import annotations

import math

from mrdamper.jobs.heat import HeatRun, sink_in_words
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.damper_section import draw_dampers, draw_field
from mrdamper.report.figures.heat import draw_fade, draw_paths, draw_temperatures
from mrdamper.report.page import environment
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.temperature_rise import Rise

__all__ = ["render_heat"]


def render_heat(run: HeatRun) -> str:
    """Return the page's HTML."""
    drawing, field = run.drawing, run.field
    title = "the damper" if drawing.sink is None else sink_in_words(drawing.sink)
    return (
        environment()
        .get_template("heat.html.j2")
        .render(
            it=run,
            rises=run.rises,
            limit=run.rise.limit_K - ZERO_CELSIUS_K,
            temperatures=draw_temperatures(
                run.rises, run.prediction_intervals, None if run.calibrated is None else run.calibrated.curve
            ),
            prediction_intervals=run.prediction_intervals,
            inf=math.inf,
            paths=draw_paths(run.rises),
            fade=draw_fade(run.rises),
            section=draw_dampers([(title, drawing)], "The damper to scale"),
            field=""
            if field is None
            else draw_field(field.model.section, field.model.mesh, field.celsius, "Temperature field"),
            field_degC=None
            if field is None
            else [kelvin - ZERO_CELSIUS_K for kelvin in (field.fluid, field.coil, field.wall)],
            account=[_account(rise) for _, rise in run.rises],
            path_names=[path for path in PATHS if any(path in rise.energy_J for _, rise in run.rises)],
        )
    )


def _account(rise: Rise) -> dict[str, tuple[float, float]]:
    """Return energy [kJ] and its share of what went in [%], by name."""
    energy = rise.energy_J
    total = energy["mechanical"] + energy["coil"]
    return {
        name: (joule / 1e3, 100.0 * joule / total if total > 0.0 else 0.0) for name, joule in energy.items()
    }
