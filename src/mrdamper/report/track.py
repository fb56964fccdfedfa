"""The page of ``mrdamper track``: one HTML file that opens offline, as the report does."""

from __future__ import annotations

from mrdamper.report.figures.track import TrackPictures
from mrdamper.report.page import environment

__all__ = ["render_track"]


def render_track(pictures: TrackPictures) -> str:
    """Return the page's HTML."""
    run = pictures.run
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
            pictures=pictures.over_time,
            over_temperature=pictures.over_temperature,
        )
    )
