"""The page of ``mrdamper track``: one HTML file that opens offline, as the report does."""

from __future__ import annotations

from mrdamper.app.report import environment
from mrdamper.app.track_job import TrackRun
from mrdamper.app.track_plots import draw_temperatures, draw_tracking

__all__ = ["render_track"]


def render_track(run: TrackRun) -> str:
    """Return the page's HTML."""
    drawn = [each.controller for each in run.traced[0].runs] if run.traced else []
    warm = len({row.temperature_degC for row in run.rows}) > 1
    targets = list(dict.fromkeys(row.target for row in run.rows))
    worst = run.worst
    return (
        environment()
        .get_template("track.html.j2")
        .render(
            it=run,
            temperatures=sorted({row.temperature_degC for row in run.rows}),
            summary=[(target, [row for row in worst if row.target == target]) for target in targets],
            rows=[(target, [row for row in run.rows if row.target == target]) for target in targets],
            has_optimum=any(row.score.max_over_optimum is not None for row in run.rows),
            pictures=[draw_tracking(each) for each in run.traced],
            over_temperature=draw_temperatures(run, drawn) if warm else "",
        )
    )
