"""Possible causes of the deviation of one run, with their messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.settings import DEFAULTS, ConsistencySettings


@dataclass(frozen=True, slots=True)
class Cause:
    """One possible cause, its unit and its messages; ``words`` has the fields ``size`` and ``unit``."""

    unit: str
    words: str
    effect: str
    remedy: str


LEVEL_EFFECT = "Peak force and viscosity of the card are pulled towards this run's"
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        "force_delay": Cause(
            "s",
            "its force comes {size:.3g} ms later than that of the other runs, by a delay or a filter",
            "A delay is taken for hysteresis: the yield displacement comes out wrong",
            "Compare filters and converters of this file with the others'",
        ),
        "force_gain": Cause(
            "",
            "its force is {size:.3f} times that of the other runs",
            LEVEL_EFFECT,
            "Check the load cell's range and amplifier, and the current: one run does not distinguish them",
        ),
        "command_label": Cause(
            "A",
            "its force is that of the other runs at a command {size:+.3f} {unit} away from its label",
            "The force of the card is wrong near this run's command",
            "Check the current against the source's record, and the gain of the force: one run does not "
            "distinguish them",
        ),
        "force_saturation": Cause(
            "",
            "its force bends away from that of the other runs by {size:.2g} of its peak, as an "
            "amplifier does near its end",
            "Peak forces and viscosity of the card come out too small",
            "Compare the load cell's range with the peak force, and record again with a larger one",
        ),
        "force_offset_of_run": Cause(
            "N",
            "its force is shifted by {size:+.4g} N against that of the other runs",
            "A model without an offset leaves it in its error",
            "Zero the load cell before each run",
        ),
    }
)


def min_size(
    kind: str, run: PreparedRun, command_range: float, settings: ConsistencySettings = DEFAULTS
) -> float:
    """Return the smallest reported size of a cause in one run.

    The limit of a command grows with the range of the fitted commands, the limit of a delay with the period.
    """
    size = settings.limits[kind].size_min
    if kind == "command_label":
        return size * max(command_range, 1.0)
    if kind == "force_delay":
        return max(size, settings.delay_period_ratio_min * (run.period_s or 0.0))
    return size
