"""When a temperature reaches its limit, as every report says and draws it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mrdamper.report.page import Tile
from mrdamper.schema import Json, finite_or_none
from mrdamper.thermal.estimation.sampling import TimeToLimit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIMIT_COLOUR = "#a03020"
_ABOVE = 1.3  # a limit that is farther above all temperatures would flatten them


def limit_answer(limit_degC: float, to_limit: TimeToLimit) -> Json:
    """Return the keys of an answer that say when a limit is reached; null is "not reached"."""
    return {
        "limit_degC": limit_degC,
        "time_to_limit_s": finite_or_none(to_limit.median_s),
        "time_to_limit_interval_s": [finite_or_none(to_limit.low_s), finite_or_none(to_limit.high_s)],
        "limit_not_reached": to_limit.not_reached,
    }


def limit_words(limit_degC: float, to_limit: TimeToLimit, probability: float, looked_s: float) -> str:
    """Return when a limit is reached, as a line; ``looked_s`` is how far was looked, on the same clock."""
    if to_limit.not_reached > 0.5:
        share = f"{100.0 * to_limit.not_reached:.0f} %"
        return f"{limit_degC:g} degC: not reached within {looked_s / 60.0:.0f} min with {share}"
    latest = f"{to_limit.high_s / 60.0:.1f} min" if math.isfinite(to_limit.high_s) else "later than that"
    held = f"{100.0 * probability:.0f} %: {to_limit.low_s / 60.0:.1f} min to {latest}"
    return f"{limit_degC:g} degC: reached after {to_limit.median_s / 60.0:.1f} min ({held})"


def limit_tile(limit_degC: float, to_limit: TimeToLimit, probability: float) -> Tile:
    """Return the time to a limit as a figure of a first screen."""
    label = f"to the limit, {limit_degC:g} °C"
    if to_limit.not_reached > 0.5:
        return Tile("not reached", label, f"with {100.0 * to_limit.not_reached:.0f} %")
    latest = f"{to_limit.high_s / 60.0:.1f} min" if math.isfinite(to_limit.high_s) else "not reached"
    band = f"{100.0 * probability:.0f} %: {to_limit.low_s / 60.0:.1f} min to {latest}"
    return Tile(f"{to_limit.median_s / 60.0:.1f} min", label, band)


def draw_limit(axes: Axes, limit_degC: float, hottest_degC: float, start: float) -> None:
    """Draw a limit into axes of degC, named at ``start`` of the abscissa, unless it is far above all."""
    if not limit_degC < _ABOVE * hottest_degC:
        return
    axes.axhline(limit_degC, color=LIMIT_COLOUR, linewidth=0.8, linestyle=(0, (5, 2)))
    axes.annotate(
        f"limit, {limit_degC:g} °C",
        (start, limit_degC),
        (2, 2),
        textcoords="offset points",
        fontsize=6.5,
        color=LIMIT_COLOUR,
    )
