"""Possible causes of the deviation of one run from the fitted model, with their thresholds and messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Cause:
    """One possible cause of a deviation, with its thresholds.

    The *size* of a cause (for example a delay in seconds) is estimated for each run and compared with the
    size in comparable runs. The *deviation* of the run is the rms force that this difference explains,
    divided by the typical residual. The cause is reported only if the run exceeds all thresholds.
    """

    unit: str
    size_min: float  # min size; for a wrong command label multiplied by the command range, if that exceeds 1
    scatter_ratio_min: float  # min deviation, divided by the scatter of the deviations of all runs
    deviation_min: float
    words: str  # message, a format string with the fields ``size`` and ``unit``
    effect: str
    remedy: str
    weight: float = 1.0  # weight in the comparison of causes; below 1 for a less common cause


# The causes are sorted from simple to complex.
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        "force_delay": Cause(
            "s", 1.0e-3, 3.2, 0.15,
            "its force comes {size:.3g} ms later than that of the other runs, by a delay or a filter",
            "A delay is taken for hysteresis: the yield displacement comes out wrong",
            "Compare filters and converters of this file with the others'",
        ),
        "force_gain": Cause(
            "", 0.03, 2.5, 0.4,
            "its force is {size:.3f} times that of the other runs",
            "Peak force and viscosity of the card are pulled towards this run's",
            "Check the load cell's range and amplifier, and the current: one run does not distinguish them",
        ),
        "command_label": Cause(
            "A", 0.02, 2.5, 0.4,
            "its force is that of the other runs at a command {size:+.3f} {unit} away from its label",
            "The force of the card is wrong near this run's command",
            "Check the current against the source's record, and the gain of the force: one run does not "
            "distinguish them",
        ),
        "force_saturation": Cause(
            "", 0.06, 4.0, 0.4,
            "its force bends away from that of the other runs by {size:.2g} of its peak, as an "
            "amplifier does near its end",
            "Peak forces and viscosity of the card come out too small",
            "Compare the load cell's range with the peak force, and record again with a larger one",
            weight=0.7,
        ),
        "force_offset_of_run": Cause(
            "N", 3.0, 6.0, 0.5,
            "its force is shifted by {size:+.4g} N against that of the other runs",
            "A model without an offset leaves it in its error",
            "Zero the load cell before each run",
        ),
    }
)  # fmt: skip
