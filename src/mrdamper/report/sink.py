"""The page of ``mrdamper sink``: one HTML file that opens offline, as the report does."""

from __future__ import annotations

from mrdamper.jobs.sink import SinkRun
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.figures.damper_section import draw_dampers
from mrdamper.report.figures.sink import SinkPictures
from mrdamper.report.heat import sink_in_words
from mrdamper.report.page import environment
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.sinks.design import SinkDesign
from mrdamper.thermal.sinks.efficiency import DEFAULT_EFFICIENCY, EFFICIENCIES

__all__ = ["render_sink"]


def render_sink(pictures: SinkPictures) -> str:
    """Return the page's HTML."""
    run = pictures.run
    return (
        environment()
        .get_template("sink.html.j2")
        .render(
            it=run,
            zero=ZERO_CELSIUS_K,
            words=[sink_in_words(each.sink) for each in run.front if each.sink is not None],
            front=pictures.front,
            dampers=draw_dampers(_dampers(run), "Best sink and reference, to scale"),
            sweeps=pictures.sweeps,
            definitions=list(EFFICIENCIES.values()),
            default=DEFAULT_EFFICIENCY,
        )
    )


def _dampers(run: SinkRun) -> list[tuple[str, DamperDrawing]]:
    """Return what is drawn: the reference, the best, and the lightest that is as cool as the reference."""

    def titled(name: str, design: SinkDesign) -> tuple[str, DamperDrawing]:
        words = "no fins" if design.sink is None else sink_in_words(design.sink)
        figures = f"{design.fluid - ZERO_CELSIUS_K:.1f} °C, {1e3 * design.mass:.0f} g"
        return f"{name}: {figures}\n{words}", run.drawing.with_sink(design.sink)

    chosen = [titled("reference", run.reference), titled("coolest", run.best)]
    if run.lightest is not None and run.reference.sink is not None and run.lightest is not run.best:
        chosen.append(titled("lightest that is as cool as the reference", run.lightest))
    return chosen
