"""What a tracking job drew, as numbers: target, what the damper can give, what the controllers made of it."""

from __future__ import annotations

from mrdamper.jobs.track import TrackRun
from mrdamper.schema import Json

__all__ = ["traces_of"]

_MOST = 2000  # samples of a trace


def traces_of(run: TrackRun) -> list[Json]:
    """Return each target's hottest test, every k-th sample of it."""
    traces: list[Json] = []
    for each in run.traced:
        course, reach = each.course, each.reach
        part = slice(None, None, max(1, -(-len(course) // _MOST)))
        traces.append(
            {
                "target": each.target,
                "temperature_degC": each.temperature_degC,
                "time_s": course.time[part].tolist(),
                "wanted_N": course.target[part].tolist(),
                "low_N": reach.low[part].tolist(),
                "high_N": reach.high[part].tolist(),
                "runs": [
                    {
                        "controller": one.controller,
                        "force_N": one.force[part].tolist(),
                        "command_A": one.current[part].tolist(),
                    }
                    for one in each.runs
                ],
            }
        )
    return traces
